#include "worldmodel/train/shards.h"

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <map>
#include <set>
#include <sstream>
#include <string_view>
#include <system_error>

#include "worldmodel/nn/number_text.h"

namespace evac::train {
namespace {

constexpr const char* kArmsRead = "arms_read";  // shards of earlier versions do not say it
constexpr const char* kCommon[] = {"period_s", "cameras", "arms", kArmsRead, "pose_map", "delta_frames", "statistics"};

std::string Text(const TensorFile& file, const std::string& key) {
  const auto found = file.metadata().find(key);
  if (found == file.metadata().end()) throw TensorError(file.name() + ": its metadata has no '" + key + "'");
  return found->second;
}

void RequireText(const TensorFile& file, const std::string& key, const std::string& wanted) {
  const std::string found = Text(file, key);
  if (found != wanted) throw TensorError(file.name() + ": " + key + " is '" + found + "', wanted '" + wanted + "'");
}

/// Of metadata, with commas between them.
std::vector<std::string> NamesOf(const TensorFile& file, const std::string& key) {
  std::vector<std::string> found;
  std::istringstream names(Text(file, key));
  for (std::string name; std::getline(names, name, ',');) found.push_back(name);
  return found;
}

/// Who reads a view's or an arm's numbers by its name finds them there.
void RequireNames(const TensorFile& file, std::int64_t views) {
  const std::vector<std::string> cameras = NamesOf(file, "cameras");
  if (std::ssize(cameras) != views)
    throw TensorError(file.name() + ": cameras is '" + Text(file, "cameras") + "', wanted " + std::to_string(views) +
                      " names, one per view of its frames");
  const std::string arms = Text(file, "arms");
  if (arms != "right" && arms != "left,right")
    throw TensorError(file.name() + ": arms is '" + arms + "', wanted 'right' or 'left,right'");
}

/// A tensor of the wanted type and shape (-1: any).
Tensor Checked(const nn::MappedTensors& file, const std::string& name, at::ScalarType type, at::IntArrayRef shape) {
  const Tensor tensor = file.Get(name);
  nn::CheckShape(file.file().name() + ": " + name, tensor, shape);
  if (tensor.scalar_type() != type)
    throw TensorError(file.file().name() + ": " + name + " is " + Name(file.file().Get(name).type) +
                      ", wanted what docs/formats/shards.md says");
  return tensor;
}

/// The same, of finite numbers: one that is none makes the loss none, and all weights after it.
Tensor CheckedNumbers(const nn::MappedTensors& file, const std::string& name, at::IntArrayRef shape) {
  const Tensor tensor = Checked(file, name, at::kFloat, shape);
  const Tensor broken = tensor.isfinite().logical_not();
  if (!broken.any().item<bool>()) return tensor;
  const auto row = broken.nonzero()[0][0].item<std::int64_t>();
  throw TensorError(file.file().name() + ": row " + std::to_string(row) + " of " + name + " holds " +
                    std::to_string(tensor.masked_select(broken)[0].item<double>()) + ", wanted finite numbers");
}

/// Every row belongs to a clip: one that is not would be read by nobody, and nobody would say so.
void RequireWhole(const std::filesystem::path& path, const Tensor& clip_start, std::int64_t rows) {
  const auto first = clip_start[0].item<std::int64_t>(), end = clip_start[-1].item<std::int64_t>();
  if (first != 0 || end != rows)
    throw TensorError(path.string() + ": clip_start goes from " + std::to_string(first) + " to " + std::to_string(end) +
                      ", wanted 0 to " + std::to_string(rows) + ", all rows of its frames");
}

Shard Read(const std::filesystem::path& path, const nn::MappedTensors& file) {
  Shard shard;
  shard.path = path;
  shard.frames = Checked(file, "frames", at::kByte, {-1, -1, -1, -1, 3});
  const std::int64_t f = shard.frames.size(0), v = shard.frames.size(1);
  if (v < 1 || shard.frames.size(2) < 1 || shard.frames.size(3) < 1)
    throw TensorError(path.string() + ": frames is " + nn::ShapeText(shard.frames.sizes()) +
                      ", wanted at least one view of at least one pixel");
  RequireText(file.file(), "height_px", std::to_string(shard.frames.size(2)));
  RequireText(file.file(), "width_px", std::to_string(shard.frames.size(3)));
  shard.maps = Checked(file, "maps", at::kByte, shard.frames.sizes());
  shard.clip_start = Checked(file, "clip_start", at::kLong, {-1});
  const std::int64_t clips = shard.clip_start.size(0) - 1;
  if (clips < 1)
    throw TensorError(path.string() + ": clip_start has " + std::to_string(clips + 1) +
                      " numbers, wanted at least 2: the first row of a clip, and the end");
  RequireWhole(path, shard.clip_start, f);
  shard.task = Checked(file, "task", at::kInt, {clips});
  shard.outcome = Checked(file, "outcome", at::kChar, {clips});
  shard.actions = CheckedNumbers(file, "actions", {f, 16});
  shard.deltas = CheckedNumbers(file, "deltas", {f, 14});
  shard.c2w = CheckedNumbers(file, "c2w", {f, v, 4, 4});
  shard.k = CheckedNumbers(file, "k", {f, v, 3, 3});
  shard.object_px = Checked(file, "object_px", at::kFloat, {f, v, 2});
  shard.contact = Checked(file, "contact", at::kByte, {f});
  return shard;
}

const char* NameOf(Split split) { return split == Split::kTrain ? "train" : "holdout"; }

std::filesystem::path Beside(const std::filesystem::path& shard, const std::string& prefix) {
  std::string name = shard.filename().string();
  if (name.starts_with("shard_")) name = prefix + name.substr(6);
  return shard.parent_path() / name;
}

std::string ShardName(std::int64_t number) {
  char name[48];
  std::snprintf(name, sizeof name, "shard_%05lld.safetensors", static_cast<long long>(number));
  return name;
}

/// How many shards the packing of one has.
std::int64_t ShardCount(const std::filesystem::path& shard) {
  const TensorFile file = TensorFile::Open(shard);
  const std::string text = Text(file, "shards");
  std::int64_t count = 0;
  if (!nn::ParseNumber(text, count) || count < 1)
    throw TensorError(file.name() + ": shards is '" + text + "', wanted how many its packing has");
  return count;
}

/// @param found  names of shards; the packing has numbers 0 … count - 1
void RequireAllShards(const std::filesystem::path& folder, const std::set<std::string>& found, std::int64_t count) {
  constexpr int kMostNamed = 10;
  std::string missing;
  std::set<std::string> others = found;
  for (std::int64_t number = 0, named = 0; number < count && named <= kMostNamed; ++number) {
    if (others.erase(ShardName(number)) > 0) continue;
    missing += (named == 0 ? "" : ", ") + (named < kMostNamed ? ShardName(number) : "…");
    ++named;
  }
  const std::string of = folder.string() + ": its packing has " + std::to_string(count) + " shards";
  if (!missing.empty())
    throw TensorError(of + ", missing are " + missing +
                      ": wanted all, `evac pack` with the same options makes them again");
  if (!others.empty())
    throw TensorError(of + ", " + *others.begin() + " is none of them: wanted a folder for each packing");
}

std::string ReadText(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// The SHA-256 that shards.json has of one of its shards, found by the words around it: nothing here reads JSON.
/// @returns nothing if it does not say it
std::string Sha256Said(const std::string& page, const std::string& shard) {
  const std::size_t entry = page.rfind('"' + shard + '"');  // recordings come before the shards
  if (entry == std::string::npos) return "";
  constexpr std::string_view kKey = "\"sha256\"";
  const std::size_t end = page.find('}', entry), key = page.find(kKey, entry);
  if (key >= end) return "";
  const std::size_t from = page.find('"', key + kKey.size()), to = page.find('"', from + 1);
  return to < end ? page.substr(from + 1, to - from - 1) : "";
}

/// Latents are of the very file that their shard is.
/// @param page  the text of the shard's shards.json
void RequireSameShard(const TensorFile& latents, const std::filesystem::path& shard, const std::string& page) {
  const std::string found = Text(latents, "shard_sha256"), wanted = Sha256Said(page, shard.filename().string());
  if (found == wanted && !wanted.empty()) return;
  throw TensorError(latents.name() + " was made of another packing than " + shard.string() + ": shard_sha256 is '" +
                    found + "', shards.json says '" + wanted + "': wanted `evac encode` again");
}

/// What latents say that they were multiplied by.
constexpr const char* kScaleFactor = "scale_factor";

/// Latents are times the factor of the page that asks for them; those of earlier versions do not say it.
void RequireScale(const TensorFile& latents, double wanted) {
  if (MayBeScaledBy(latents.metadata(), wanted)) return;
  throw TensorError(latents.name() + ": scale_factor is '" + Text(latents, kScaleFactor) + "', wanted '" +
                    ScaleText(wanted) + "' as on the page of sizes: `evac encode` with this page");
}

/// FNV-1a, from what was hashed before.
std::uint64_t Hashed(std::uint64_t hash, std::span<const std::byte> bytes) {
  for (const std::byte byte : bytes) hash = (hash ^ std::to_integer<std::uint64_t>(byte)) * 0x100000001b3;
  return hash;
}

/// @param of  which clip of which file, for the message
std::int8_t CheckedOutcome(const std::string& of, std::int8_t outcome) {
  if (outcome < -1 || outcome > 1)
    throw TensorError(of + " has outcome " + std::to_string(outcome) +
                      ", wanted 1 for success, 0 for failure or -1 where it is unknown");
  return outcome;
}

/// @param tasks  of this shard's numbers, what they are in the set
std::vector<Clip> ClipsOf(const Shard& shard, std::size_t index, const std::vector<std::int32_t>& tasks) {
  std::vector<Clip> clips;
  const auto* starts = shard.clip_start.data_ptr<std::int64_t>();
  const std::int64_t count = shard.clip_start.size(0) - 1;
  for (std::int64_t i = 0; i < count; ++i) {
    if (starts[i] < 0 || starts[i + 1] <= starts[i] || starts[i + 1] > shard.frames.size(0))
      throw TensorError(shard.path.string() + ": clip " + std::to_string(i) + " has rows " + std::to_string(starts[i]) +
                        " to " + std::to_string(starts[i + 1]) + " of " + std::to_string(shard.frames.size(0)));
    const std::int32_t task = shard.task.data_ptr<std::int32_t>()[i];
    if (task < 0 || task >= std::ssize(tasks))
      throw TensorError(shard.path.string() + ": clip " + std::to_string(i) + " is of task " + std::to_string(task) +
                        ", wanted 0 … " + std::to_string(std::ssize(tasks) - 1) + ", one of its metadata's");
    clips.push_back({index, starts[i], starts[i + 1] - starts[i], tasks[static_cast<std::size_t>(task)],
                     CheckedOutcome(shard.path.string() + ": clip " + std::to_string(i),
                                    shard.outcome.data_ptr<std::int8_t>()[i])});
  }
  return clips;
}

/// What lies beside a shard: "no variants", "variants of count 4 and seed 1".
std::string HowVaried(const std::filesystem::path& shard) {
  const std::filesystem::path path = VariantsPath(shard);
  if (!std::filesystem::exists(path)) return "no variants";
  const TensorFile file = TensorFile::Open(path);
  const auto said = [&](const char* key) {
    const auto found = file.metadata().find(key);
    return found == file.metadata().end() ? std::string("unknown") : found->second;
  };
  return "variants of count " + said("count") + " and seed " + said("seed");
}

/// Killed half way, one that varies a folder otherwise than it was leaves some shards as they were.
void RequireVariedAlike(const std::vector<Shard>& shards) {
  std::map<std::filesystem::path, std::pair<std::filesystem::path, std::string>> first;  // of each folder
  for (const Shard& shard : shards) {
    const std::string how = HowVaried(shard.path);
    const auto [found, is_first] = first.try_emplace(shard.path.parent_path(), shard.path, how);
    const auto& [other, wanted] = found->second;
    if (how == wanted) continue;
    throw TensorError(shard.path.string() + " has " + how + ", " + other.filename().string() + " has " + wanted +
                      ": wanted the same of all shards of a folder, as an `evac vary` leaves it that came to its end");
  }
}

}  // namespace

ShardFolders EachOnce(const ShardFolders& folders) {
  ShardFolders once;
  for (const std::filesystem::path& folder : folders) {
    const bool is_again = std::any_of(once.begin(), once.end(), [&](const std::filesystem::path& other) {
      std::error_code unknown;  // what cannot be looked at is told where it is read
      return folder == other || std::filesystem::equivalent(folder, other, unknown);
    });
    if (!is_again) once.push_back(folder);
  }
  return once;
}

std::string ScaleText(double scale_factor) {
  char text[32];
  std::snprintf(text, sizeof text, "%.17g", scale_factor);
  return text;
}

bool MayBeScaledBy(const TensorMetadata& latents, double scale_factor) {
  const auto found = latents.find(kScaleFactor);
  return found == latents.end() || found->second == ScaleText(scale_factor);
}

std::filesystem::path LatentsPath(const std::filesystem::path& shard) { return Beside(shard, "latents_"); }

std::filesystem::path VariantsPath(const std::filesystem::path& shard) { return Beside(shard, "variants_"); }

std::string RecipesOf(const ShardFolders& folders) {
  std::string recipes;
  for (const std::filesystem::path& folder : folders) {
    if (!recipes.empty()) recipes += ',';
    recipes += Text(TensorFile::Open(ShardPaths(folder).front()), "recipe");
  }
  return recipes;
}

bool HasSplit(const std::filesystem::path& folder, Split split) {
  const std::vector<std::filesystem::path> shards = ShardPaths(folder);
  return std::any_of(shards.begin(), shards.end(),
                     [&](const std::filesystem::path& path) { return Text(TensorFile::Open(path), "split") == NameOf(split); });
}

std::vector<std::filesystem::path> ShardPaths(const std::filesystem::path& folder) {
  if (!std::filesystem::exists(folder / "shards.json"))
    throw TensorError(folder.string() + " has no shards.json: wanted a folder that `evac pack` has finished");
  std::set<std::string> found;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with("shard_") && name.ends_with(".safetensors")) found.insert(name);
  }
  if (found.empty()) throw TensorError(folder.string() + " has shards.json and no shard: wanted those that it lists");
  const std::int64_t count = ShardCount(folder / *found.begin());
  RequireAllShards(folder, found, count);
  std::vector<std::filesystem::path> paths;
  for (std::int64_t number = 0; number < count; ++number) paths.push_back(folder / ShardName(number));
  return paths;
}

std::string ShardSet::FolderNames() const {
  std::string names;
  for (const std::filesystem::path& folder : folders_) names += (names.empty() ? "" : ", ") + folder.string();
  return names;
}

ShardSet::ShardSet(const ShardFolders& folders, Split split) : folders_(folders), split_(split) {
  std::string recipes, tasks;
  const auto append = [](std::string& list, const char* separator, const std::string& one) {
    if (!list.empty()) list += separator;
    list += one;
  };
  for (const std::filesystem::path& folder : folders) {
    const std::vector<std::filesystem::path> paths = ShardPaths(folder);
    const TensorFile first = TensorFile::Open(paths.front());
    append(recipes, ",", Text(first, "recipe"));
    for (const std::string& task : NamesOf(first, "tasks")) {  // whether this split has clips of it or not
      if (std::find(tasks_.begin(), tasks_.end(), task) == tasks_.end()) tasks_.push_back(task);
    }
    for (const std::filesystem::path& path : paths) Add(path, split);
  }
  for (const std::string& task : tasks_) append(tasks, ",", task);
  if (shards_.empty())
    throw TensorError(FolderNames() + " has no shard with split " + NameOf(split) + " (evac pack --holdout)");
  metadata_["recipe"] = recipes;
  metadata_["tasks"] = tasks;
}

void ShardSet::Add(const std::filesystem::path& path, Split split) {
  const nn::MappedTensors file(TensorFile::Open(path));
  RequireText(file.file(), "format", "evac-shard");
  RequireText(file.file(), "version", "1");
  if (Text(file.file(), "split") != NameOf(split)) return;
  Shard shard = Read(path, file);
  RequireNames(file.file(), shard.frames.size(1));
  if (!shards_.empty()) nn::CheckShape(path.string() + ": frames", shard.frames, {-1, views(), height_px(), width_px(), 3});
  if (shards_.empty()) metadata_ = file.file().metadata();
  CheckSame(path.string(), file.file().metadata());
  const auto arms_read = file.file().metadata().find(kArmsRead);
  if (arms_read != file.file().metadata().end()) metadata_.insert(*arms_read);
  std::vector<std::int32_t> tasks;
  for (const std::string& task : NamesOf(file.file(), "tasks")) {
    const auto found = std::find(tasks_.begin(), tasks_.end(), task);
    if (found == tasks_.end())
      throw TensorError(path.string() + ": task '" + task + "' is none of its folder's first shard");
    tasks.push_back(static_cast<std::int32_t>(found - tasks_.begin()));
  }
  for (const Clip& clip : ClipsOf(shard, shards_.size(), tasks)) clips_.push_back(clip);
  shards_.push_back(std::move(shard));
}

void ShardSet::CheckSame(const std::string& name, const TensorMetadata& metadata) const {
  for (const std::string key : kCommon) {
    const auto found = metadata.find(key);
    const TensorMetadata::const_iterator wanted = metadata_.find(key);
    if (key == kArmsRead && (found == metadata.end() || wanted == metadata_.end())) continue;
    const bool same = (found == metadata.end()) == (wanted == metadata_.end()) &&
                      (found == metadata.end() || found->second == wanted->second);
    if (same) continue;
    std::string what = name + ": " + key + " differs from that of " + shards_.front().path.string();
    if (key == "statistics") what += ": wanted `evac pack --statistics` with the former's";
    if (key == kArmsRead)
      what += " ('" + found->second + "', '" + wanted->second + "'): wanted `evac pack --arms` alike";
    throw TensorError(what);
  }
}

void ShardSet::OpenLatents(std::int64_t z, std::int64_t stride, std::optional<double> scale_factor) {
  std::map<std::filesystem::path, std::string> pages;  // of each folder
  products_.clear();
  for (Shard& shard : shards_) {
    const std::filesystem::path path = LatentsPath(shard.path);
    if (!std::filesystem::exists(path))
      throw TensorError(shard.path.string() + " has no latents: wanted " + path.string() + ", which `evac encode` writes");
    const nn::MappedTensors file(TensorFile::Open(path));
    RequireText(file.file(), "format", "evac-latents");
    RequireText(file.file(), "version", "1");
    const std::vector<std::int64_t> shape = {shard.frames.size(0), views(), z, height_px() / stride, width_px() / stride};
    shard.latents = Checked(file, "latents", at::kHalf, shape);
    shard.map_latents = Checked(file, "map_latents", at::kHalf, shape);
    if (codec_.empty()) codec_ = Text(file.file(), "codec");
    RequireText(file.file(), "codec", codec_);
    if (scale_factor) RequireScale(file.file(), *scale_factor);
    const std::filesystem::path folder = shard.path.parent_path();
    if (!pages.contains(folder)) pages[folder] = ReadText(folder / "shards.json");
    RequireSameShard(file.file(), shard.path, pages[folder]);
    products_.push_back(Text(file.file(), "products"));
  }
  if (std::set<std::string>(products_.begin(), products_.end()).size() == 1) products_.resize(1);
}

std::string ShardSet::LatentsIdentity() const {
  std::string text = codec_;
  if (products_.empty() || products_ == std::vector<std::string>{"float32"}) return text;
  text += " products";
  for (const std::string& products : products_) text += " " + products;
  return text;
}

void ShardSet::OpenVariants() {
  variants_.clear();
  variants_hash_ = 0;
  RequireVariedAlike(shards_);
  for (std::size_t index = 0; index < shards_.size(); ++index) {
    Shard& shard = shards_[index];
    const std::filesystem::path path = VariantsPath(shard.path);
    if (!std::filesystem::exists(path)) continue;
    const nn::MappedTensors file(TensorFile::Open(path));
    RequireText(file.file(), "format", "evac-variants");
    RequireText(file.file(), "version", "1");
    RequireText(file.file(), "recipe", Text(TensorFile::Open(shard.path), "recipe"));
    variants_hash_ = Hashed(variants_hash_ == 0 ? 0xcbf29ce484222325 : variants_hash_, file.file().bytes());
    const Tensor clip = Checked(file, "clip", at::kLong, {-1});
    const std::int64_t count = clip.size(0), clips = shard.clip_start.size(0) - 1;
    const Tensor start = Checked(file, "start", at::kLong, {count + 1}), outcome = Checked(file, "outcome", at::kChar, {count});
    shard.variant_actions = CheckedNumbers(file, "actions", {-1, 16});
    const std::int64_t rows = shard.variant_actions.size(0);
    shard.variant_object_px = Checked(file, "object_px", at::kFloat, {rows, views(), 2});
    const auto* starts = start.data_ptr<std::int64_t>();
    for (std::int64_t i = 0; i < count; ++i) {
      const std::int64_t of = clip.data_ptr<std::int64_t>()[i];
      if (of < 0 || of >= clips || starts[i] < 0 || starts[i + 1] <= starts[i] || starts[i + 1] > rows)
        throw TensorError(path.string() + ": variant " + std::to_string(i) + " is of clip " + std::to_string(of) + " of " +
                          std::to_string(clips) + " and has rows " + std::to_string(starts[i]) + " to " +
                          std::to_string(starts[i + 1]) + " of " + std::to_string(rows));
      variants_.push_back({index, shard.clip_start.data_ptr<std::int64_t>()[of], starts[i], starts[i + 1] - starts[i],
                           CheckedOutcome(path.string() + ": variant " + std::to_string(i),
                                          outcome.data_ptr<std::int8_t>()[i])});
    }
  }
}

std::int64_t ShardSet::frame_count() const {
  std::int64_t count = 0;
  for (const Shard& shard : shards_) count += shard.frames.size(0);
  return count;
}

Tensor PicturesFrom(const Tensor& bytes) { return bytes.permute({0, 3, 1, 2}).to(at::kFloat) / 127.5 - 1; }

}  // namespace evac::train
