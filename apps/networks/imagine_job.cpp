#include "apps/networks/imagine_job.h"

#include "apps/networks/imagine_output.h"
#include "apps/networks/imagined_page.h"
#include "core/config.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/version.h"
#include "worldmodel/action_statistics.h"
#include "worldmodel/nn/library.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// The words that say the same again, from anywhere, but for where to (--out).
std::vector<std::string> CommandWords(const ImagineArguments& arguments, const ImagineStart& start) {
  std::vector<std::string> words = {"evac", "imagine"};
  const auto say = [&](const char* option, const std::string& value) {
    if (!value.empty()) words.insert(words.end(), {option, value});
  };
  const auto path = [&](const char* option, const fs::path& value) {
    if (!value.empty()) say(option, fs::absolute(value).lexically_normal().string());
  };
  const ImagineInputs& inputs = arguments.inputs;
  path("--recording", inputs.recording);
  path("--frame", inputs.files.frame);
  path("--actions", inputs.files.actions);
  path("--extrinsics", inputs.files.extrinsics);
  path("--intrinsics", inputs.files.intrinsics);
  say("--cameras", fmt::format("{}", fmt::join(inputs.cameras, ",")));
  say("--arms", inputs.arms);
  say("--stride", std::to_string(start.stride));
  path("--config", arguments.config);
  path("--statistics", arguments.statistics);
  path("--weights", arguments.weights);
  if (arguments.chunks > 0) say("--chunks", std::to_string(arguments.chunks));
  const SamplerArguments& sampler = arguments.sampler;
  say("--solver", sampler.solver);
  say("--steps", std::to_string(sampler.steps));
  say("--eta", fmt::format("{}", sampler.eta));
  say("--cfg", fmt::format("{}", sampler.cfg));
  say("--cfg-rescale", fmt::format("{}", sampler.cfg_rescale));
  say("--seed", std::to_string(sampler.seed));
  say("--dtype", sampler.dtype);
  say("--device", sampler.device);
  say("--threads", std::to_string(sampler.threads));
  say("--reference-quirks", arguments.quirks);
  if (arguments.scaled_maps) words.push_back("--scaled-maps");
  return words;
}

Json QuirksOf(const std::string& names) {
  const ReferenceQuirks quirks = ReferenceQuirks::Named(names);
  return {{"residual_noise", quirks.residual_noise},
          {"memory_not_scaled", quirks.memory_not_scaled},
          {"delta_window", quirks.delta_window},
          {"draw_behind_camera", quirks.draw_behind_camera},
          {"decoded_start", quirks.decoded_start}};
}

Json FilesOf(const std::vector<fs::path>& paths) {
  Json files = Json::array();
  for (const fs::path& path : paths)
    files.push_back({{"path", fs::absolute(path).lexically_normal().string()}, {"sha256", Sha256HexOfFile(path)}});
  return files;
}

bool LiesIn(const fs::path& path, const fs::path& folder) {
  const fs::path from_folder = fs::weakly_canonical(path).lexically_relative(fs::weakly_canonical(folder));
  return !from_folder.empty() && *from_folder.begin() != "..";
}

/// Before hours are spent, and before anything goes.
/// @param is_claimed  OUT says what was imagined there
void RequireOthersFilesStay(const ImagineArguments& arguments, const ImagineStart& start, bool is_claimed) {
  const fs::path frames = arguments.out / "frames";
  std::vector<fs::path> replaced = {arguments.out / "maps"};
  if (arguments.png || (arguments.restart && is_claimed)) replaced.push_back(frames);
  for (const fs::path& folder : replaced) {
    RequireOwnPictures(folder);
    for (const fs::path& file : start.files) {
      if (LiesIn(file, folder))
        throw InvalidInput("{}: lies in {}, which would be replaced; wanted another --out", file.string(),
                           folder.string());
    }
  }
  if (arguments.png && fs::exists(frames) && !fs::is_empty(frames) && !is_claimed)
    throw InvalidInput("{}: is there, and nothing was imagined here yet ({} is missing); wanted that name free, or "
                       "another --out", frames.string(), kImagined);
}

/// chunk_00000.safetensors, and .partial-4711 of a process that was killed
bool IsChunk(const std::string& name) {
  const std::size_t digits_end = name.find_first_not_of("0123456789", 6);
  return name.starts_with("chunk_") && digits_end != std::string::npos && digits_end > 6 &&
         name.substr(digits_end).starts_with(".safetensors");
}

/// What a job left. Its sidecar goes last: until then what else is there is a job's.
void RemoveJob(const fs::path& out) {
  if (fs::is_directory(out / "chunks")) {
    std::vector<fs::path> chunks;
    for (const fs::directory_entry& entry : fs::directory_iterator(out / "chunks")) {
      if (IsChunk(entry.path().filename().string())) chunks.push_back(entry.path());
    }
    for (const fs::path& chunk : chunks) fs::remove(chunk);
  }
  for (const char* part : {"frames", "maps", "imagined.mp4", kImagined}) fs::remove_all(out / part);
}

}  // namespace

Json JobOf(const ImagineArguments& arguments, const ImagineStart& start) {
  const SamplerArguments& sampler = arguments.sampler;
  const ActionStatistics statistics = StatisticsOf(arguments);
  return {{"evac", EVAC_VERSION},
          {"libtorch", nn::LibtorchVersion()},
          {"weights", Sha256HexOfFile(arguments.weights)},
          {"config", arguments.config.empty() ? "published" : Config::FromFile(arguments.config).Canonical()},
          {"statistics", {{"mean", statistics.mean}, {"deviation", statistics.deviation}}},
          {"first_frame", HashOf(start.scene)},
          {"actions", HashOf(start.arms)},
          {"stride", start.stride},
          {"solver", sampler.solver},
          {"steps", sampler.steps},
          {"eta", sampler.eta},
          {"cfg", sampler.cfg},
          {"cfg_rescale", sampler.cfg_rescale},
          {"seed", sampler.seed},
          {"dtype", sampler.dtype},
          {"device", sampler.device},
          {"threads", sampler.threads},
          {"scaled_maps", arguments.scaled_maps},
          {"reference_quirks", QuirksOf(arguments.quirks)}};
}

Sidecar::Sidecar(const ImagineArguments& arguments, const ImagineStart& start, Json job)
    : out_(arguments.out), hash_(Sha256Hex(job.dump())) {
  page_ = {{"job", std::move(job)},
           {"source", start.source},
           {"inputs", FilesOf(start.files)},
           {"command", CommandWords(arguments, start)},
           {"period_s", start.period_s}};
  const fs::path path = out_ / kImagined;
  const bool is_claimed = fs::exists(path);
  const Json before = is_claimed ? JobOnPage(ReadFile(path), path.string()) : Json();
  if (is_claimed && !arguments.restart) Refuse(before);
  RequireOthersFilesStay(arguments, start, is_claimed);
  if (is_claimed && arguments.restart) RemoveJob(out_);
}

void Sidecar::Refuse(const Json& job) const {
  const std::string differences = DifferencesOf(page_.at("job"), job);
  if (differences.empty()) return;
  throw InvalidInput("{}: another job's frames are there{}; choose another --out, or --restart to throw them away",
                     out_.string(), differences);
}

void Sidecar::Write(const Json& page) const { WriteFileAtomically(out_ / kImagined, page.dump(2) + "\n"); }

void Sidecar::WriteBegun() const {
  Json page = page_;
  page["finished"] = false;
  Write(page);
}

void Sidecar::WriteFinished(const FinishedVideo& video, double seconds) const {
  Json page = page_;
  page["finished"] = true;
  page["frames"] = video.frames;
  page["video"] = {{"file", video.path.filename().string()}, {"sha256", video.sha256}};
  page["seconds"] = seconds;
  Write(page);
}

}  // namespace evac
