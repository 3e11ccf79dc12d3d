#include "core/store_study.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/parse_json.h"
#include "core/store_study_database.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr std::int64_t kApplicationId = 0x65767374;  // "evst"
constexpr const char* kFile = "study.sqlite";

constexpr std::pair<RaterRole, const char*> kRoles[] = {
    {RaterRole::kRater, "rater"}, {RaterRole::kAdjudicator, "adjudicator"}, {RaterRole::kLead, "lead"}};
constexpr std::pair<Showing, const char*> kShowings[] = {
    {Showing::kCounted, "counted"}, {Showing::kGold, "gold"},     {Showing::kPractice, "practice"},
    {Showing::kExample, "example"}, {Showing::kRepeat, "repeat"}, {Showing::kAdjudication, "adjudication"},
    {Showing::kImport, "import"}};

constexpr const char* kWhole = "every row that another one names";

std::int64_t Pragma(sqlite::Connection& connection, const char* sql) {
  sqlite::Statement statement = connection.Query(sql);
  return statement.Step() ? statement.Integer(0) : 0;
}

void Check(sqlite::Connection& connection, const fs::path& file) {
  const std::int64_t version = Pragma(connection, "PRAGMA user_version");
  if (Pragma(connection, "PRAGMA application_id") != kApplicationId || version != 1)
    throw InvalidInput("{}: is no study that this evac knows (version {})", file.string(), version);
}

std::uint64_t SeedIn(const std::string& text, const fs::path& folder) {
  std::uint64_t seed = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), seed);
  if (error != std::errc() || end != text.data() + text.size())
    throw DamagedStudy(folder, fmt::format("its seed is '{}'", text), "a whole number");
  return seed;
}

bool HasTexts(const Json& object, std::initializer_list<const char*> names) {
  return object.is_object() && std::ranges::all_of(names, [&](const char* name) {
           const auto found = object.find(name);
           return found == object.end() || found->is_string();
         });
}

/// Null for what is no JSON, or no such as we write.
Json ParsedOrNull(const std::string& text) try {
  return ParseJson<Json>(text);
} catch (const Json::exception&) {
  return Json();
}

/// As raters, board and labels read it.
void CheckRubric(const StudyRubric& rubric, const fs::path& folder) {
  const Json document = ParsedOrNull(rubric.document);
  const bool has_texts = HasTexts(document, {"instruction", "success", "version"});
  const Json stages = has_texts ? document.value("stages", Json::array()) : Json();
  const auto is_stage = [](const Json& stage) { return HasTexts(stage, {"name", "description"}); };
  if (!stages.is_array() || !std::ranges::all_of(stages, is_stage))
    throw DamagedStudy(folder, fmt::format("the rubric {} of task {} is none", rubric.hash, rubric.task),
                       "JSON: instruction, success, version, stages [{name, description}]");
}

void CheckViews(const StudyClip& clip, const fs::path& folder) {
  if (!ParsedOrNull(clip.views).is_array())
    throw DamagedStudy(folder, fmt::format("the views of clip {} are none", clip.id),
                       "JSON: [{name, x, y, width, height}]");
}

constexpr const char* kClipColumns =
    "SELECT id, wave, run, episode, task, initial_state, policy, checkpoint, world, is_real, source_sha256, use, "
    "reference, reference_reason, rubric_hash, views, file, video_sha256, frames FROM clips ";

std::string ClipQuery(const char* which) {
  std::string query = kClipColumns;
  query += which;
  return query;
}

StudyClip ClipOf(const sqlite::Statement& row, const fs::path& folder) {
  StudyClip clip;
  clip.id = row.Integer(0);
  clip.wave = static_cast<int>(row.Integer(1));
  clip.run = row.Text(2);
  clip.episode = row.Text(3);
  clip.task = row.Text(4);
  clip.initial_state = row.Text(5);
  clip.policy = row.Text(6);
  clip.checkpoint = row.Text(7);
  clip.world = row.Text(8);
  clip.is_real = row.Integer(9) != 0;
  clip.source_sha256 = row.Text(10);
  clip.use = ShowingFromName(row.Text(11));
  if (!row.IsNull(12)) clip.reference = LabelFromName(row.Text(12));
  clip.reference_reason = row.Text(13);
  clip.rubric_hash = row.Text(14);
  clip.views = row.Text(15);
  clip.file = row.Text(16);
  clip.video_sha256 = row.Text(17);
  clip.frames = static_cast<int>(row.Integer(18));
  CheckViews(clip, folder);
  return clip;
}

std::string LineOf(const StudyClip& clip) {
  return clip.run + "\n" + clip.episode + "\n" + clip.rubric_hash + "\n" + clip.video_sha256 + "\n" + Name(clip.use) +
         "\n";
}

}  // namespace

Error DamagedStudy(const fs::path& folder, const std::string& field, const char* wanted) {
  return InvalidInput("{}: the study is damaged: {}, wanted {}", (folder / kFile).string(), field, wanted);
}

fs::path OneFormOf(const fs::path& run) {
  std::error_code is_not_there;
  fs::path form = fs::canonical(run, is_not_there);
  return is_not_there ? fs::absolute(run).lexically_normal() : form;
}

const char* Name(RaterRole role) {
  for (const auto& [known, name] : kRoles) {
    if (known == role) return name;
  }
  throw InternalError("a role without a name");
}

RaterRole RaterRoleFromName(const std::string& name) {
  for (const auto& [role, known] : kRoles) {
    if (known == name) return role;
  }
  throw InvalidInput("role: found '{}', wanted rater, adjudicator or lead", name);
}

const char* Name(Showing showing) {
  for (const auto& [known, name] : kShowings) {
    if (known == showing) return name;
  }
  throw InternalError("a showing without a name");
}

Showing ShowingFromName(const std::string& name) {
  for (const auto& [showing, known] : kShowings) {
    if (known == name) return showing;
  }
  throw InvalidInput("the study is damaged: '{}' is no way to show a clip", name);
}

StudyStore::StudyStore(std::unique_ptr<Database> database) : database_(std::move(database)) {}
StudyStore::StudyStore(StudyStore&&) noexcept = default;
StudyStore& StudyStore::operator=(StudyStore&&) noexcept = default;
StudyStore::~StudyStore() = default;

bool StudyStore::IsIn(const fs::path& folder) {
  if (!fs::exists(folder / kFile)) return false;
  sqlite::Connection connection = sqlite::Connection::OpenReadOnly(folder / kFile);
  return Pragma(connection, "SELECT count(*) FROM sqlite_schema") > 0;
}

StudyStore StudyStore::Create(const fs::path& folder, const StudyInfo& info) {
  const fs::path file = folder / kFile;
  if (IsIn(folder)) throw InvalidInput("{}: there is a study already", folder.string());
  MakeFolders(folder);
  auto database = std::make_unique<Database>(Database{folder, sqlite::Connection::OpenReadWrite(file)});
  sqlite::Connection& connection = database->connection;
  sqlite::Transaction transaction(connection);
  connection.RunScript(kStudySchema);
  connection.RunScript(kStudyIndexes);
  connection.RunScript(fmt::format("PRAGMA application_id = {}", kApplicationId));
  connection.Run("INSERT INTO study VALUES (1, ?, ?, ?, ?, ?, ?, ?)", info.name, std::to_string(info.seed),
                 info.raters_per_clip, info.width_px, info.height_px, info.period_s, info.evac_version);
  transaction.Commit();
  return StudyStore(std::move(database));
}

StudyStore StudyStore::Open(const fs::path& folder, Mode mode) {
  const fs::path file = folder / kFile;
  if (!IsIn(folder)) {
    throw InvalidInput("{}: there is no study ({} {})", folder.string(), kFile,
                       fs::exists(file) ? "was never begun" : "is missing");
  }
  auto database =
      std::make_unique<Database>(Database{folder, mode == Mode::kReadOnly ? sqlite::Connection::OpenReadOnly(file)
                                                                          : sqlite::Connection::OpenReadWrite(file)});
  Check(database->connection, file);
  if (mode == Mode::kReadWrite) database->connection.RunScript(kStudyIndexes);
  return StudyStore(std::move(database));
}

const fs::path& StudyStore::folder() const { return database_->folder; }

StudyInfo StudyStore::info() const {
  sqlite::Statement row = database_->connection.Query(
      "SELECT name, seed, raters_per_clip, width_px, height_px, period_s, evac_version FROM study");
  if (!row.Step()) throw DamagedStudy(folder(), "the table study has no row", "the one that says how it was begun");
  StudyInfo info;
  info.name = row.Text(0);
  info.seed = SeedIn(row.Text(1), folder());
  info.raters_per_clip = static_cast<int>(row.Integer(2));
  info.width_px = static_cast<int>(row.Integer(3));
  info.height_px = static_cast<int>(row.Integer(4));
  info.period_s = row.Real(5);
  info.evac_version = row.Text(6);
  return info;
}

void StudyStore::RequireWhole() const {
  info();
  sqlite::Connection& connection = database_->connection;
  sqlite::Statement broken = connection.Query("PRAGMA foreign_key_check");  // table, rowid, the other one, which key
  if (!broken.Step()) return;
  const std::string table = broken.Text(0), other = broken.Text(2);
  sqlite::Statement key =
      connection.Query("SELECT \"from\" FROM pragma_foreign_key_list(?) WHERE id = ?", table, broken.Integer(3));
  const std::string column = key.Step() ? key.Text(0) : "";
  sqlite::Statement named = connection.Query(
      fmt::format("SELECT \"{}\" FROM \"{}\" WHERE rowid = ?", column, table).c_str(), broken.Integer(1));
  const std::string value = named.Step() ? named.Text(0) : "";
  throw DamagedStudy(
      folder(),
      fmt::format("row {} of {} names {} '{}', which {} does not have", broken.Integer(1), table, column, value, other),
      kWhole);
}

void StudyStore::Begin() { database_->connection.Run("BEGIN IMMEDIATE"); }
void StudyStore::Commit() { database_->connection.Run("COMMIT"); }
void StudyStore::Rollback() { database_->connection.Run("ROLLBACK"); }
void StudyStore::Mark() { database_->connection.Run("SAVEPOINT one"); }
void StudyStore::Release() { database_->connection.Run("RELEASE one"); }
void StudyStore::Undo() { database_->connection.RunScript("ROLLBACK TO one; RELEASE one"); }

std::string StudyStore::AddWave(std::span<const StudyClip> clips, std::span<const StudyRubric> rubrics,
                                const std::string& codec_sha256) {
  sqlite::Connection& connection = database_->connection;
  const int wave = Waves() + 1;
  std::string list;
  for (const StudyClip& clip : clips) list += LineOf(clip);
  const std::string hash = Sha256Hex(list);
  sqlite::Transaction transaction(connection);
  connection.Run("INSERT INTO waves VALUES (?, ?)", wave, hash);
  if (!codec_sha256.empty()) connection.Run("INSERT INTO round_trips VALUES (?, ?)", wave, codec_sha256);
  for (const StudyRubric& rubric : rubrics)
    connection.Run("INSERT OR IGNORE INTO rubrics VALUES (?, ?, ?)", rubric.hash, rubric.task, rubric.document);
  for (const StudyClip& clip : clips) {
    connection.Run(
        "INSERT INTO clips (wave, run, episode, task, initial_state, policy, checkpoint, world, is_real, "
        "source_sha256, "
        "use, reference, reference_reason, rubric_hash, views, file, video_sha256, frames) VALUES (?, ?, ?, ?, ?, ?, "
        "?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
        wave, clip.run, clip.episode, clip.task, clip.initial_state, clip.policy, clip.checkpoint, clip.world,
        clip.is_real ? 1 : 0, clip.source_sha256, Name(clip.use),
        clip.reference ? std::optional<std::string>(Name(*clip.reference)) : std::nullopt, clip.reference_reason,
        clip.rubric_hash, clip.views, clip.file, clip.video_sha256, clip.frames);
  }
  transaction.Commit();
  return hash;
}

/// Names and seeds are alike in many studies; the file of the first clip has a random name.
std::string StudyStore::Id() const {
  const StudyInfo begun = info();
  std::string identity = "study\n" + begun.name + "\n" + std::to_string(begun.seed) + "\n";
  sqlite::Statement row = database_->connection.Query("SELECT file FROM clips ORDER BY id LIMIT 1");
  if (row.Step()) identity += row.Text(0);
  std::string id = Sha256Hex(identity);
  id.resize(12);
  return id;
}

std::string StudyStore::Codec() const {
  sqlite::Connection& connection = database_->connection;
  if (Pragma(connection, "SELECT count(*) FROM sqlite_schema WHERE name = 'round_trips'") == 0) return {};
  sqlite::Statement row = connection.Query("SELECT codec_sha256 FROM round_trips ORDER BY wave LIMIT 1");
  return row.Step() ? row.Text(0) : std::string();
}

int StudyStore::Waves() const { return static_cast<int>(Pragma(database_->connection, "SELECT count(*) FROM waves")); }

std::vector<StudyClip> StudyStore::Clips() const {
  sqlite::Statement row = database_->connection.Query(ClipQuery("ORDER BY id").c_str());
  std::vector<StudyClip> clips;
  while (row.Step()) clips.push_back(ClipOf(row, folder()));
  return clips;
}

StudyClip StudyStore::Clip(std::int64_t id) const {
  sqlite::Statement row = database_->connection.Query(ClipQuery("WHERE id = ?").c_str(), id);
  if (!row.Step()) throw DamagedStudy(folder(), fmt::format("there is no clip {}", id), kWhole);
  return ClipOf(row, folder());
}

std::vector<StudyRubric> StudyStore::Rubrics() const {
  sqlite::Statement row = database_->connection.Query("SELECT hash, task, document FROM rubrics ORDER BY task, hash");
  std::vector<StudyRubric> rubrics;
  while (row.Step()) rubrics.push_back({row.Text(0), row.Text(1), row.Text(2)});
  for (const StudyRubric& rubric : rubrics) CheckRubric(rubric, folder());
  return rubrics;
}

std::map<std::int64_t, std::int64_t> StudyStore::Votes() const {
  sqlite::Statement row = database_->connection.Query("SELECT clip, count(*) FROM votes GROUP BY clip");
  std::map<std::int64_t, std::int64_t> votes;
  while (row.Step()) votes[row.Integer(0)] = row.Integer(1);
  return votes;
}

}  // namespace evac
