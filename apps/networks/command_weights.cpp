#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/commands.h"
#include "apps/network_parts.h"
#include "core/hash.h"
#include "core/version.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/evac_model.h"
#include "worldmodel/nn/mean_weights.h"
#include "worldmodel/nn/weight_keys.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/train/train_world.h"
#include "worldmodel/train/weight_files.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

struct WeightsArguments {
  std::string in, out, config, forecast, shards;
  std::vector<std::string> several;
  std::string dtype = "f32";
  std::uint64_t seed = 0;
  bool json = false, list = false, touch = false, lean = false, for_training = false;
};

const std::map<std::string, at::ScalarType> kTypes = {{"f32", at::kFloat}, {"bf16", at::kBFloat16}, {"f16", at::kHalf}};

nn::ModelConfig ConfigOf(const WeightsArguments& arguments) {
  return arguments.config.empty() ? nn::ModelConfig{} : ReadEvacConfig(arguments.config);
}

double Seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }
double Gigabytes(std::size_t bytes) { return static_cast<double>(bytes) / 1e9; }
std::string Size(std::size_t bytes) {
  return bytes < 1'000'000'000 ? fmt::format("{:.2f} MB", static_cast<double>(bytes) / 1e6)
                               : fmt::format("{:.2f} GB", Gigabytes(bytes));
}

/// "3.2 of 9.3 GB, 410 MB/s, 15 s left" on stderr: redrawn on a terminal, every tenth in a log; nothing for small
/// files.
class ByteProgress {
 public:
  void operator()(std::size_t done, std::size_t total) {
    const bool terminal = ::isatty(STDERR_FILENO) != 0;
    const std::size_t tenth = 10 * done / std::max<std::size_t>(total, 1);
    const double elapsed_s = Seconds(Clock::now() - started_);
    if (total < 100'000'000 || (terminal ? elapsed_s < shown_s_ + 0.2 && done < total : tenth == tenth_)) return;
    tenth_ = tenth;
    shown_s_ = elapsed_s;
    const double rate = static_cast<double>(done) / std::max(elapsed_s, 1e-3);
    std::fputs(fmt::format("{}{:.1f} of {:.1f} GB, {:.0f} MB/s, {:.0f} s left{}", terminal ? "\r" : "", Gigabytes(done),
                           Gigabytes(total), rate / 1e6, static_cast<double>(total - done) / rate,
                           terminal && done < total ? "  " : "\n")
                   .c_str(),
               stderr);
  }

 private:
  Clock::time_point started_ = Clock::now();
  double shown_s_ = -1;
  std::size_t tenth_ = 0;
};

/// What a file holds, and how it fits a configuration if one was asked about.
struct Inspection {
  std::size_t bytes = 0, numbers = 0;
  std::map<std::string, std::size_t> numbers_by_part, bytes_by_type;
  std::optional<nn::KeyFit> fit;
  std::string schedule;  ///< why the file's is put aside, or is not the page's
  bool is_of_schedule = true;
  std::optional<double> touched_s;

  /// @pre a page was given
  bool Fits() const { return fit->Fits() && is_of_schedule; }
};

/// "model.diffusion_model", "first_stage_model", …
std::string PartOf(const std::string& key) {
  const std::size_t dot = key.find('.');
  if (dot == std::string::npos) return "schedule";
  return key.starts_with("model.") ? key.substr(0, key.find('.', dot + 1)) : key.substr(0, dot);
}

std::size_t CountOf(const TensorView& tensor) { return tensor.ByteCount() / BytesOf(tensor.type); }

/// Reads one byte of every page, in the file's order.
double Touch(const TensorFile& file) {
  const Clock::time_point start = Clock::now();
  ByteProgress progress;
  std::size_t done = 0;
  unsigned sum = 0;
  for (const TensorView& tensor : file.tensors()) {
    for (std::size_t i = 0; i < tensor.bytes.size(); i += 4096) sum += static_cast<unsigned>(tensor.bytes[i]);
    progress(done += tensor.bytes.size(), file.bytes().size());
  }
  const volatile unsigned used = sum;
  static_cast<void>(used);
  return Seconds(Clock::now() - start);
}

/// Of weights whose keys fit: whether their noise is the page's too.
void AskSchedule(const WeightsArguments& arguments, Inspection& found) try {
  found.schedule = nn::FileWeights(arguments.in, ConfigOf(arguments)).report().schedule;
} catch (const TensorError& error) {
  found.schedule = error.what();
  found.is_of_schedule = false;
}

Inspection Inspect(const TensorFile& file, const WeightsArguments& arguments) {
  Inspection found;
  for (const TensorView& tensor : file.tensors()) {
    found.bytes += tensor.bytes.size();
    found.numbers += CountOf(tensor);
    found.numbers_by_part[PartOf(tensor.name)] += CountOf(tensor);
    found.bytes_by_type[Name(tensor.type)] += tensor.bytes.size();
  }
  if (!arguments.config.empty()) {
    found.fit = nn::CompareKeys(file, ConfigOf(arguments));
    if (found.fit->Fits()) AskSchedule(arguments, found);
  }
  if (arguments.touch) found.touched_s = Touch(file);
  return found;
}

Json AsJson(const TensorFile& file, const Inspection& found) {
  Json json = {{"file", file.name()},
               {"tensors", file.tensors().size()},
               {"numbers", found.numbers},
               {"bytes", found.bytes},
               {"metadata", file.metadata()},
               {"numbers_by_part", found.numbers_by_part},
               {"bytes_by_type", found.bytes_by_type}};
  if (found.fit) {
    json["fits"] = found.Fits();
    json["missing"] = found.fit->missing;
    json["extra"] = found.fit->extra;
    json["misshapen"] = found.fit->misshapen;
    json["unread"] = found.fit->unread;
    json["schedule"] = found.schedule;
  }
  if (found.touched_s) json["touched_s"] = *found.touched_s;
  Json list = Json::array();
  for (const TensorView& tensor : file.tensors())
    list.push_back({{"name", tensor.name}, {"type", Name(tensor.type)}, {"shape", tensor.shape}});
  json["list"] = list;
  return json;
}

void PrintText(const TensorFile& file, const Inspection& found, bool list) {
  if (list) {
    for (const TensorView& tensor : file.tensors())
      fmt::print("{:5} {:20} {}\n", Name(tensor.type), nn::ShapeText(tensor.shape), tensor.name);
  }
  fmt::print("{}: {} tensors, {} numbers, {}\n", file.name(), file.tensors().size(), found.numbers, Size(found.bytes));
  for (const auto& [part, numbers] : found.numbers_by_part) fmt::print("  {:28} {:>13} numbers\n", part, numbers);
  for (const auto& [type, bytes] : found.bytes_by_type) fmt::print("  {:28} {:>13}\n", type, Size(bytes));
  for (const auto& [key, value] : file.metadata()) fmt::print("  {}: {}\n", key, value);
  if (found.touched_s)
    fmt::print("every page touched in {:.2f} s: {:.0f} MB/s\n", *found.touched_s,
               static_cast<double>(found.bytes) / 1e6 / *found.touched_s);
  if (!found.fit) return;
  const std::string complaint = found.is_of_schedule ? found.fit->Complaint() : found.schedule;
  fmt::print("{}\n", found.Fits() ? fmt::format("fits; {} of its keys are read by nothing", found.fit->unread.size())
                                  : "does not fit: " + complaint);
  if (found.is_of_schedule && !found.schedule.empty()) fmt::print("{}\n", found.schedule);
}

ExitCode RunInspect(const WeightsArguments& arguments) {
  const TensorFile file = TensorFile::OpenCheckpoint(arguments.in);
  const Inspection found = Inspect(file, arguments);
  if (arguments.json) {
    fmt::print("{}\n", AsJson(file, found).dump(2, ' ', false, Json::error_handler_t::replace));
  } else {
    PrintText(file, found, arguments.list);
  }
  return !found.fit || found.Fits() ? ExitCode::kOk : ExitCode::kNo;
}

void DemandNew(const std::string& out) {
  if (fs::exists(out)) throw InvalidInput("{}: is there already; wanted a new file", out);
}

void Save(const WeightsArguments& arguments, nn::ParameterSource& source, nn::SaveOptions options) {
  options.dtype = kTypes.at(arguments.dtype);
  options.progress = ByteProgress();
  nn::SaveWeights(arguments.out, source, ConfigOf(arguments), options);
  fmt::print("{}: {}\n", arguments.out, Size(fs::file_size(arguments.out)));
}

/// What nothing reads.
std::vector<std::string> Unread(const nn::ModelConfig& config) {
  const std::vector<nn::ParameterShape> keys = nn::CheckpointKeys(config);
  const std::set<std::string> dead = nn::DeadKeys(keys);
  std::vector<std::string> unread(dead.begin(), dead.end());
  for (const auto& [key, shape] : keys) {
    if (nn::IsClipLeftover(key)) unread.push_back(key);
  }
  return unread;
}

/// What the source lacks, or carries in another shape, among what nothing reads.
std::vector<std::string> LeftOut(const nn::FileWeights& source, const WeightsArguments& arguments) {
  if (arguments.lean) return Unread(ConfigOf(arguments));
  std::vector<std::string> left_out;
  for (const auto& [key, shape] : nn::CheckpointKeys(ConfigOf(arguments))) {
    if (!source.Has(key) || source.file().Get(key).shape != shape) left_out.push_back(key);
  }
  return left_out;
}

/// Weights of other sizes than the published ones need their page: a list of keys that do not fit would not say so.
void DemandPage(const WeightsArguments& arguments) {
  if (!arguments.config.empty()) return;
  const nn::KeyFit fit = nn::CompareKeys(TensorFile::OpenCheckpoint(arguments.in), nn::ModelConfig{});
  if (fit.Fits()) return;
  throw InvalidInput(
      "{}: not of the published network's sizes ({} keys missing, {} not its own, {} of another shape; the first: {}); "
      "wanted --config PAGE with its own sizes",
      arguments.in, fit.missing.size(), fit.extra.size(), fit.misshapen.size(),
      !fit.misshapen.empty() ? fit.misshapen[0]
      : !fit.missing.empty() ? fit.missing[0] + " is missing"
                             : fit.extra[0] + " is not its own");
}

/// What the weights were trained for, of weights that do not say it, from the shards that they learned from.
/// @throws InvalidInput, TensorError for shards that no network of the page's sizes learned from
void AddWhatFor(const WeightsArguments& arguments, TensorMetadata& metadata) {
  const std::string &shards = arguments.shards, &weights = arguments.in;
  const train::ShardSet set(shards, train::Split::kTrain);
  const nn::ModelConfig config = ConfigOf(arguments);
  if (set.views() != config.views || set.height_px() != config.image_height_px ||
      set.width_px() != config.image_width_px)
    throw InvalidInput("--shards {}: found {} views of {}x{} px, wanted {} of {}x{}, as {} has", shards, set.views(),
                       set.width_px(), set.height_px(), config.views, config.image_width_px, config.image_height_px,
                       arguments.config.empty() ? "the published network" : arguments.config);
  train::CheckPoseMaps(set, config);
  for (const auto& [key, value] : train::WhatFor(set.metadata())) {
    const auto [found, is_new] = metadata.emplace(key, value);
    if (!is_new && found->second != value)
      throw InvalidInput("{}: its {} is '{}', that of --shards {} is '{}'", weights, key, found->second, shards, value);
  }
}

ExitCode RunConvert(const WeightsArguments& arguments) {
  DemandNew(arguments.out);
  DemandPage(arguments);
  nn::FileWeights source(arguments.in, ConfigOf(arguments),
                         {.dtype = kTypes.at(arguments.dtype), .with_unread = true, .is_run = false});
  if (!source.report().schedule.empty()) fmt::print(stderr, "{}\n", source.report().schedule);
  nn::SaveOptions options;
  options.without = LeftOut(source, arguments);
  for (const auto& [key, value] : source.file().metadata()) {
    if (key != "layout") options.metadata.emplace(key, value);
  }
  if (!arguments.shards.empty()) AddWhatFor(arguments, options.metadata);
  if (arguments.forecast.empty()) {
    Save(arguments, source, std::move(options));
    return ExitCode::kOk;
  }
  if (!ConfigOf(arguments).object_forecast)
    throw InvalidInput("--forecast {}: the page of sizes has object_forecast: false, wanted true", arguments.forecast);
  train::CheckForecastFor(arguments.forecast, train::WhatForecastIsFor(options.metadata, ConfigOf(arguments)));
  train::CheckpointWeights forecast(arguments.forecast);
  train::RoutedWeights routed({{nn::kForecastPrefix, &forecast}, {"", &source}});
  std::erase_if(options.without, [](const std::string& key) { return key.starts_with(nn::kForecastPrefix); });
  options.metadata["forecast"] = Sha256HexOfFile(arguments.forecast);
  options.metadata.erase("holdout");  // it was measured with the other one
  Save(arguments, routed, std::move(options));
  return ExitCode::kOk;
}

ExitCode RunMean(const WeightsArguments& arguments) {
  DemandNew(arguments.out);
  nn::MeanWeights source({arguments.several.begin(), arguments.several.end()}, ConfigOf(arguments));
  nn::SaveOptions options;
  options.without = Unread(ConfigOf(arguments));
  for (const auto& [key, value] : source.Metadata()) {
    if (key != "layout") options.metadata.emplace(key, value);
  }
  std::string hashes;
  for (const std::string& file : arguments.several) hashes += (hashes.empty() ? "" : ",") + Sha256HexOfFile(file);
  options.metadata["mean_of"] = hashes;
  Save(arguments, source, std::move(options));
  return ExitCode::kOk;
}

ExitCode RunInit(const WeightsArguments& arguments) {
  DemandNew(arguments.out);
  using Last = nn::RandomWeights::LastLayers;
  nn::RandomWeights source(arguments.seed, arguments.for_training ? Last::kZero : Last::kDrawn);
  nn::SaveOptions options;
  options.metadata["evac"] = fmt::format("{}: random, seed {}", EVAC_VERSION, arguments.seed);
  Save(arguments, source, std::move(options));
  return ExitCode::kOk;
}

using Arguments = std::shared_ptr<WeightsArguments>;

void AddConfig(CLI::App& command, const Arguments& arguments) {
  command.add_option("--config", arguments->config, "page with the network's sizes; the published ones if not given")
      ->check(CLI::ExistingFile);
}

/// @param name  "OUT", or "--out" behind any number of files
void AddOut(CLI::App& command, const Arguments& arguments, const std::string& name = "OUT") {
  command.add_option(name, arguments->out, "a new .safetensors; there whole or not at all")->required();
  command.add_option("--dtype", arguments->dtype, "f32, bf16 or f16")
      ->check(CLI::IsMember({"f32", "bf16", "f16"}))
      ->capture_default_str();
  AddConfig(command, arguments);
}

void AddInspect(CLI::App& group, const Arguments& arguments, ExitCode& exit_code) {
  CLI::App* command = group.add_subcommand("inspect", "Say what a file of weights holds, and whether it fits.");
  command->add_option("FILE", arguments->in, ".safetensors, or .pt/.ckpt of torch.save")->required();
  command->add_option("--config", arguments->config, "page with sizes: does the file fit them? Exit code 1 if not")
      ->check(CLI::ExistingFile);
  command->add_flag("--list", arguments->list, "every tensor: type, shape, name");
  command->add_flag("--touch", arguments->touch, "read every page and say how long it took");
  command->add_flag("--json", arguments->json, "for programs: docs/weights.md");
  command->footer(
      "Examples:\n"
      "  evac weights inspect evac.ckpt\n"
      "  evac weights inspect mine.safetensors --config apps/configs/evac_published.yaml --json | jq .missing");
  command->callback([arguments, &exit_code] { exit_code = RunInspect(*arguments); });
}

void AddConvert(CLI::App& group, const Arguments& arguments, ExitCode& exit_code) {
  CLI::App* command = group.add_subcommand(
      "convert", "Write weights as .safetensors, in another type, one tensor in memory at a time.");
  command->add_option("IN", arguments->in, ".safetensors, or .pt/.ckpt of torch.save")->required();
  AddOut(*command, arguments);
  command->add_flag("--lean", arguments->lean, "leave out what nothing reads");
  command->add_option("--forecast", arguments->forecast, "of `evac train forecast`: takes the place of the one in IN")
      ->check(CLI::ExistingFile);
  command->add_option("--shards", arguments->shards,
                      "what IN learned from: OUT says what it is for, where IN does not (period, cameras, statistics, …)")
      ->check(CLI::ExistingDirectory);
  command->footer(
      "Examples:\n"
      "  evac weights convert evac.ckpt evac.safetensors\n"
      "  evac weights convert evac.ckpt evac_bf16.safetensors --dtype bf16 --lean");
  command->callback([arguments, &exit_code] { exit_code = RunConvert(*arguments); });
}

void AddMean(CLI::App& group, const Arguments& arguments, ExitCode& exit_code) {
  CLI::App* command =
      group.add_subcommand("mean", "Write the mean of several trainings of one network, without what nothing reads.");
  command->add_option("IN", arguments->several, "two or more files of one size")->required()->expected(2, 1000);
  AddOut(*command, arguments, "-o,--out");
  command->footer(
      "For trainings that began from common weights; its metadata say which files it is of (mean_of: SHA-256).\n"
      "Example:\n"
      "  evac weights mean first.safetensors second.safetensors --config mine.yaml --dtype bf16 --out mean.safetensors");
  command->callback([arguments, &exit_code] { exit_code = RunMean(*arguments); });
}

void AddInit(CLI::App& group, const Arguments& arguments, ExitCode& exit_code) {
  CLI::App* command =
      group.add_subcommand("init", "Write random weights: a seed gives the same file on every machine.");
  AddOut(*command, arguments);
  command->add_option("--seed", arguments->seed, "of every number")->capture_default_str();
  command->add_flag("--for-training", arguments->for_training, "last layers of every block zero, as training starts");
  command->footer(
      "Examples:\n"
      "  evac weights init random.safetensors --dtype bf16\n"
      "  evac weights init start.safetensors --config small.yaml --seed 7 --for-training");
  command->callback([arguments, &exit_code] { exit_code = RunInit(*arguments); });
}

}  // namespace

void AddWeights(CLI::App& app, ExitCode& exit_code) {
  CLI::App* group = app.add_subcommand(kWeightsCommand.name, kWeightsCommand.what);
  group->require_subcommand(1);
  const auto arguments = std::make_shared<WeightsArguments>();
  AddInspect(*group, arguments, exit_code);
  AddConvert(*group, arguments, exit_code);
  AddMean(*group, arguments, exit_code);
  AddInit(*group, arguments, exit_code);
}

}  // namespace evac
