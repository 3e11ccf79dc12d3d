#include "reports/gate_baseline.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>
#include <tuple>

#include "core/config.h"
#include "core/hash.h"
#include "core/parse_json.h"
#include "core/store_codec.h"
#include "reports/gate_data.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kFormat = "evac pinned result";
constexpr int kSchema = 1;

Json BodyOf(const PinnedResult& pinned) {
  Json json = {{"format", kFormat},
               {"schema", kSchema},
               {"run", pinned.run},
               {"suite_hash", pinned.suite_hash},
               {"store_hash", pinned.store_hash},
               {"judge", pinned.judge},
               {"tasks", pinned.tasks},
               {"worlds", pinned.worlds}};
  for (const auto& [key, map] : {std::pair("scenes", &pinned.scenes), std::pair("definitions", &pinned.definitions),
                                 std::pair("settings", &pinned.settings)}) {
    if (!map->empty()) json[key] = *map;
  }
  json["cells"] = Json::array();
  for (const PinnedCell& cell : pinned.cells) {
    Json outcomes = Json::array();
    for (const PinnedOutcome& one : cell.outcomes)
      outcomes.push_back(
          {{"state", one.initial_state}, {"seed", one.seed}, {"outcome", Name(one.outcome)}, {"video", one.video}});
    json["cells"].push_back({{"task", cell.task},
                             {"world", cell.world},
                             {"policy", cell.policy},
                             {"initial_states_hash", cell.InitialStatesHash()},
                             {"outcomes", std::move(outcomes)}});
  }
  return json;
}

std::string Dump(const Json& json, int indent = -1) {
  return json.dump(indent, ' ', false, Json::error_handler_t::replace);
}

/// What the page says, whatever its layout; a task without a page is told by its rubric.
std::string HashOf(const Task& task) {
  if (task.page.empty()) return Sha256Hex(task.id + "\n" + task.instruction + "\n" + task.rubric.version);
  return Config::FromText(task.page, task.id).ContentHash();
}

/// Of recordings, what depends on which of them there are is left out: their states are compared as states.
std::string HashOfDefinition(Task task) {
  if (task.page.empty()) {
    task.max_chunks = 0;
    task.workspace_m = Task{}.workspace_m;
    for (Camera& camera : task.cameras)
      camera = {.name = camera.name, .width_px = camera.width_px, .height_px = camera.height_px};
  }
  return Sha256Hex(codec::EncodeTask(task));
}

/// "0.1" and "0.10" are one latency.
std::string LatencyIn(const Config& suite) {
  const std::string text = suite.Has("policy") ? suite.Section("policy").Get<std::string>("latency", "off") : "off";
  char* end = nullptr;
  const double seconds = std::strtod(text.c_str(), &end);
  return text.empty() || *end != '\0' ? text : fmt::format("{} s", seconds);
}

/// What the suite says for all its tasks and policies alike. Of one that cannot be read nothing is known.
std::map<std::string, std::string> SettingsOf(const std::string& suite_text) try {
  const Config suite = Config::FromText(suite_text, "suite");
  return {{"chunk_size", std::to_string(suite.Get<int>("chunk_size", 8))},
          {"max_chunks", suite.Get<std::string>("max_chunks", "not said")},
          {"policy.latency", LatencyIn(suite)}};
} catch (const Error&) {
  return {};
}

/// A JSON value that knows where it stands, so that every complaint names the field.
class Field {
 public:
  Field(const Json& json, const std::string& file, std::string name)
      : json_(json), file_(file), name_(std::move(name)) {}

  Field At(const std::string& key) const {
    if (!json_.is_object() || !json_.contains(key)) Child(key, Json()).Complain("a value");
    return Child(key, json_.at(key));
  }
  std::vector<Field> Items() const {
    if (!json_.is_array()) Complain("a list");
    std::vector<Field> items;
    for (std::size_t i = 0; i < json_.size(); ++i) items.push_back(Child(std::to_string(i), json_[i]));
    return items;
  }
  std::string Text() const {
    if (!json_.is_string()) Complain("a text");
    return json_.get<std::string>();
  }
  std::uint64_t Count() const {
    if (!json_.is_number_unsigned()) Complain("a whole number, 0 or more");
    return json_.get<std::uint64_t>();
  }
  std::map<std::string, std::string> Texts() const {
    if (!json_.is_object()) Complain("an object of texts");
    std::map<std::string, std::string> texts;
    for (const auto& [key, value] : json_.items()) texts[key] = Child(key, value).Text();
    return texts;
  }
  /// Of a field that a file may lack.
  std::map<std::string, std::string> TextsOf(const std::string& key) const {
    if (!json_.is_object() || !json_.contains(key)) return {};
    return At(key).Texts();
  }
  void Require(bool holds, const std::string& wanted) const {
    if (!holds) Complain(wanted);
  }
  [[noreturn]] void Complain(const std::string& wanted) const {
    constexpr std::size_t kMostShown = 60;
    const std::string found = json_.is_null() ? "nothing" : Dump(json_);
    throw InvalidInput("{}: field {}: found {}{}, wanted {}", file_, name_, found.substr(0, kMostShown),
                       found.size() > kMostShown ? "…" : "", wanted);
  }

 private:
  Field Child(const std::string& key, const Json& json) const {
    return {json, file_, name_.empty() ? key : name_ + "." + key};
  }
  const Json& json_;
  const std::string& file_;
  std::string name_;
};

Outcome OutcomeOfName(const Field& field) {
  for (std::size_t i = 0; i < kOutcomes; ++i) {
    if (field.Text() == Name(static_cast<Outcome>(i))) return static_cast<Outcome>(i);
  }
  field.Complain("success, failure, cannot_tell, invalid, error or unjudged");
}

PinnedCell CellOf(const Field& field) {
  PinnedCell cell{field.At("task").Text(), field.At("world").Text(), field.At("policy").Text(), {}};
  std::set<std::pair<std::string, std::uint64_t>> seen;
  for (const Field& item : field.At("outcomes").Items()) {
    const PinnedOutcome& one = cell.outcomes.emplace_back(PinnedOutcome{
        item.At("state").Text(), item.At("seed").Count(), OutcomeOfName(item.At("outcome")), item.At("video").Text()});
    item.At("state").Require(seen.insert({one.initial_state, one.seed}).second, "each state and seed once");
  }
  field.At("initial_states_hash")
      .Require(field.At("initial_states_hash").Text() == cell.InitialStatesHash(),
               "the hash of the states listed, " + cell.InitialStatesHash());
  return cell;
}

Json Parsed(const std::string& text, const std::string& file) {
  try {
    return ParseJson<Json>(text);
  } catch (const Json::other_error&) {
    throw InvalidInput("{}: lists and objects lie more than 32 deep", file);
  } catch (const Json::exception& error) {
    throw InvalidInput("{}: found no JSON, wanted a result that `evac gate pin` wrote: {}", file, error.what());
  }
}

}  // namespace

std::string PinnedCell::InitialStatesHash() const {
  std::string list;
  for (const PinnedOutcome& one : outcomes) list += one.initial_state + "\t" + std::to_string(one.seed) + "\n";
  return Sha256Hex(list);
}

std::vector<std::string> PinnedResult::Policies() const {
  std::set<std::string> names;
  for (const PinnedCell& cell : cells) names.insert(cell.policy);
  return {names.begin(), names.end()};
}

PinnedResult Pin(const RunSummary& summary, const std::string& run) {
  PinnedResult pinned;
  pinned.run = run;
  pinned.suite_hash = summary.data.run.suite_hash;
  pinned.store_hash = DataHash(summary.data);
  pinned.judge = summary.options.judge;
  for (const Task& task : summary.data.tasks) {
    pinned.tasks[task.id] = HashOf(task);
    pinned.definitions[task.id] = HashOfDefinition(task);
  }
  pinned.scenes = summary.data.page_hashes;
  pinned.settings = SettingsOf(summary.data.run.suite_text);
  for (const WorldInfo& world : summary.data.worlds) pinned.worlds[world.name] = world.profile_hash;
  std::map<std::tuple<std::string, std::string, std::string>, std::vector<PinnedOutcome>> cells;
  for (const JudgedEpisode& judged : summary.episodes) {
    const auto& [pair, world] = judged.episode.key;
    cells[{pair.task, world, PolicyLabel(pair.policy, pair.checkpoint)}].push_back(
        {pair.initial_state, pair.seed, judged.outcome, judged.episode.video});
  }
  for (auto& [key, outcomes] : cells) {
    std::ranges::sort(outcomes, {}, [](const PinnedOutcome& one) { return std::tie(one.initial_state, one.seed); });
    pinned.cells.push_back({std::get<0>(key), std::get<1>(key), std::get<2>(key), std::move(outcomes)});
  }
  pinned.sha256 = Sha256Hex(Dump(BodyOf(pinned)));
  return pinned;
}

std::string PinnedJson(const PinnedResult& pinned) {
  Json json = BodyOf(pinned);
  json["sha256"] = Sha256Hex(Dump(json));
  return Dump(json, 1) + "\n";
}

PinnedResult ReadPinned(const std::string& text, const std::string& file) {
  Json json = Parsed(text, file);
  const Field page(json, file, "");
  page.At("format").Require(page.At("format").Text() == kFormat, std::string("\"") + kFormat + "\"");
  page.At("schema").Require(page.At("schema").Count() == kSchema,
                            std::to_string(kSchema) + ": pin it again with this evac");
  PinnedResult pinned;
  pinned.run = page.At("run").Text();
  pinned.suite_hash = page.At("suite_hash").Text();
  pinned.store_hash = page.At("store_hash").Text();
  pinned.judge = page.At("judge").Text();
  pinned.tasks = page.At("tasks").Texts();
  pinned.worlds = page.At("worlds").Texts();
  pinned.scenes = page.TextsOf("scenes");
  pinned.definitions = page.TextsOf("definitions");
  pinned.settings = page.TextsOf("settings");
  for (const Field& cell : page.At("cells").Items()) pinned.cells.push_back(CellOf(cell));
  pinned.sha256 = page.At("sha256").Text();
  json.erase("sha256");
  if (const std::string hash = Sha256Hex(Dump(json)); hash != pinned.sha256) {
    throw InvalidInput(
        "{}: field sha256: found {}, wanted {}: the file was changed after it was pinned; pin the run again", file,
        pinned.sha256, hash);
  }
  return pinned;
}

}  // namespace evac
