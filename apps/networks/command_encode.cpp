#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <functional>
#include <future>
#include <memory>
#include <optional>
#include <thread>
#include <vector>

#include "apps/commands.h"
#include "apps/network_parts.h"
#include "apps/warnings.h"
#include "core/config.h"
#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/store_lock.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/library.h"
#include "worldmodel/nn/threads.h"
#include "worldmodel/nn/weights.h"
#include "worldmodel/train/encode_shards.h"
#include "worldmodel/train/imagine_shards.h"
#include "worldmodel/train/sha256.h"
#include "worldmodel/train/trainable_weights.h"
#include "worldmodel/train/weight_files.h"
#include "worldmodel/trained_for.h"

namespace evac {
namespace {

struct EncodeArguments {
  std::string shards, config, codec, imagined;
  std::int64_t steps = 2;
  int threads = 0;
  bool bf16 = false;
  std::string device = "cpu";
};

int ThreadsOf(const EncodeArguments& arguments) {
  const auto cores = static_cast<int>(std::thread::hardware_concurrency());
  return arguments.threads > 0 ? arguments.threads : std::max(1, cores);
}

at::Device DeviceOf(const EncodeArguments& arguments) {
  if (arguments.device == "cuda" && !nn::HasCuda())
    throw InvalidInput("--device cuda: the libtorch that evac was built with has no CUDA; wanted cpu");
  return arguments.device == "cuda" ? at::kCUDA : at::kCPU;
}

/// Calls `work` with 0 … count - 1. Each thread takes a shard of its own: threads that share a picture's layers wait for
/// each other after each of them.
void ForEachShard(const EncodeArguments& arguments, std::size_t count, const std::function<void(std::size_t)>& work) {
  const nn::LibraryThreads one_each(1);
  std::atomic<std::size_t> next = 0;
  const auto take = [&] {
    nn::UseLibraryThreadsHere(1);
    for (std::size_t i = next++; i < count; i = next++) work(i);
  };
  std::vector<std::future<void>> others;
  for (int thread = 1; thread < ThreadsOf(arguments); ++thread) others.push_back(std::async(std::launch::async, take));
  take();
  for (std::future<void>& other : others) other.get();
}

std::string ProductsOf(const EncodeArguments& arguments) {
  return std::string(arguments.bf16 ? "bfloat16" : "float32") + (arguments.device == "cpu" ? "" : " on cuda");
}

/// Beside latents that are to be made in `folder`: which evac began those that are so.
/// @param how  whatever shard they are of
void KeepWhoBeganLatents(const std::filesystem::path& folder, const std::vector<std::filesystem::path>& shards,
                         const train::EncodeOptions& how) {
  const bool is_begun = std::ranges::any_of(shards, [&](const std::filesystem::path& shard) {
    return train::IsEncoded(folder / shard.filename(), how);
  });
  KeepWhoBegan(folder / "latents_begun_by", is_begun, "what is encoded in " + folder.string());
}

ExitCode Encode(const EncodeArguments& arguments) {
  const nn::ModelConfig config = ReadEvacConfig(arguments.config);
  train::CheckpointWeights file(arguments.codec);
  const at::Device device = DeviceOf(arguments);
  train::TrainableWeights weights(file, arguments.bf16 ? at::kBFloat16 : at::kFloat, device);
  const nn::Vae vae(nn::Scope(weights, train::kCodecPrefix), config.vae);
  const std::string codec = train::CodecSha256(arguments.codec);
  const std::vector<std::filesystem::path> shards = train::ShardPaths(arguments.shards);
  const train::EncodeOptions alike{codec, "", ProductsOf(arguments), config.vae.scale_factor, device};
  std::vector<train::EncodeOptions> options(shards.size(), alike);
  std::atomic<bool> lacks_some = false;
  ForEachShard(arguments, shards.size(), [&](std::size_t i) {
    options[i].shard_sha256 = Sha256HexOfFile(shards[i]);
    if (!train::IsEncoded(shards[i], options[i])) lacks_some = true;
  });
  std::optional<RunLock> lock;
  if (lacks_some) lock.emplace(std::filesystem::path(arguments.shards) / "lock");  // else nothing is written
  KeepWhoBeganLatents(arguments.shards, shards, alike);
  std::atomic<std::size_t> encoded = 0;
  ForEachShard(arguments, shards.size(), [&](std::size_t i) {
    if (train::IsEncoded(shards[i], options[i])) return;
    train::EncodeShard(vae, shards[i], options[i]);
    fmt::print(stderr, "{}: encoded, {} of {}\n", train::LatentsPath(shards[i]).string(), ++encoded, shards.size());
  });
  fmt::print("{}: latents of {} shards, {} of them new\n", arguments.shards, shards.size(), encoded.load());
  return ExitCode::kOk;
}

/// The same file in another folder, without a copy where the disk can.
void LinkInto(const std::filesystem::path& folder, const std::filesystem::path& file) {
  const std::filesystem::path to = folder / file.filename();
  if (std::filesystem::exists(to)) {
    if (std::filesystem::equivalent(file, to) || Sha256HexOfFile(file) == Sha256HexOfFile(to)) return;
    throw InvalidInput("{} is another file than {}: wanted a folder of its own for each packing", to.string(), file.string());
  }
  LinkOrCopy(file, to);
}

/// @throws InvalidInput, TensorError where the shards are not what the world model learned from: what differs
void CheckLearnedFrom(const train::ShardSet& set, const TrainedFor& trained, const nn::ModelConfig& config,
                      const EncodeArguments& arguments) {
  const std::string& who = arguments.shards;
  const TrainedFor shards = TrainedFor::Of(who, set.metadata());  // the same words: weights have them from shards
  if (shards.period_s) trained.CheckPeriod(*shards.period_s, who);
  trained.CheckCameras(shards.cameras, who);
  trained.CheckArms(shards.arms, who);
  trained.CheckPoseMap(shards.pose_map, who);
  trained.CheckPoseMap(config.pose_map.Words(config.image_height_px), arguments.config);
  if (shards.statistics) trained.CheckStatistics(*shards.statistics, who);
}

/// A packing as SHARDS, whose latents are what a world model imagines of its clips; shards.json comes last. Where
/// another world model's latents are replaced, it goes first: killed half way, the folder holds both, and nothing reads
/// it.
ExitCode Imagine(const EncodeArguments& arguments) {
  const std::filesystem::path from = arguments.shards, to = arguments.imagined;
  if (std::filesystem::exists(to) && std::filesystem::equivalent(from, to))
    throw InvalidInput("--imagined {}: wanted another folder than that of the shards", to.string());
  const nn::ModelConfig config = ReadEvacConfig(arguments.config);
  nn::LoadOptions options;
  if (arguments.bf16) options = {.dtype = at::kBFloat16, .products = at::kBFloat16};
  const nn::EvacModel model = nn::LoadModel(arguments.codec, config, options);
  const std::string codec = train::CodecSha256(arguments.codec);
  const TrainedFor trained = TrainedFor::Read(arguments.codec);
  const std::string products =
      fmt::format("{}, imagined by {} in {} steps with page {}", ProductsOf(arguments), Sha256HexOfFile(arguments.codec),
                  arguments.steps, Config::FromFile(arguments.config).ContentHash());
  MakeFolders(to);
  const RunLock lock(to / "lock");
  if (std::filesystem::exists(to / "shards.json")) LinkInto(to, from / "shards.json");  // refuses another packing's
  std::size_t shards = 0;
  std::atomic<std::size_t> imagined = 0;
  for (const train::Split split : {train::Split::kTrain, train::Split::kHoldout}) {
    if (!train::HasSplit(from, split)) continue;
    train::ShardSet set(from, split);
    CheckLearnedFrom(set, trained, config, arguments);
    set.OpenLatents(config.vae.z_channels, config.vae.Stride(), config.vae.scale_factor);
    if (set.codec() != codec)
      throw TensorError(arguments.codec + " did not make the shards' latents: wanted `evac encode` with it first");
    if (shards == 0)  // the first of both splits: nothing was refused
      KeepWhoBeganLatents(to, train::ShardPaths(from), {codec, "", products, config.vae.scale_factor});
    ForEachShard(arguments, set.shards().size(), [&](std::size_t i) {
      const std::filesystem::path shard = set.shards()[i].path, own = to / shard.filename();
      LinkInto(to, shard);
      if (train::IsEncoded(own, {codec, Sha256HexOfFile(shard), products, config.vae.scale_factor})) return;
      std::filesystem::remove(to / "shards.json");
      train::WriteImaginedLatents(model, set, i, to, products, {.steps = arguments.steps});
      ++imagined;
      fmt::print(stderr, "{}: imagined, {} of {} of this split\n", train::LatentsPath(own).string(), i + 1,
                 set.shards().size());
    });
    shards += set.shards().size();
  }
  for (const char* name : {"statistics.yaml", "packing.json", "left_out.csv", "shards.json"}) {
    if (std::filesystem::exists(from / name)) LinkInto(to, from / name);
  }
  fmt::print("{}: imagined latents of {} shards, {} of them new\n", to.string(), shards, imagined.load());
  return ExitCode::kOk;
}

}  // namespace

void AddEncode(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<EncodeArguments>();
  CLI::App* command = app.add_subcommand(kEncodeCommand.name, kEncodeCommand.what);
  command->add_option("SHARDS", arguments->shards, "a folder of `evac pack`")->required()->check(CLI::ExistingDirectory);
  command->add_option("--config", arguments->config, "the page of the network's sizes")->required()->check(CLI::ExistingFile);
  command->add_option("--codec", arguments->codec, "weights of the codec, alone or in a checkpoint")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("--threads", arguments->threads, "default: one per core")->check(CLI::Range(1, 1024));
  command->add_flag("--bf16", arguments->bf16,
                    "products in bf16: faster, two to three digits");
  CLI::Option* imagined = command->add_option(
      "--imagined", arguments->imagined,
      "a folder that becomes the same shards with other latents: what the world model beside the codec imagines of each "
      "recording, told what was told, from its first picture on");
  command->add_option("--device", arguments->device, "cpu, or cuda where libtorch has it")
      ->check(CLI::IsMember({"cpu", "cuda"}))
      ->capture_default_str()
      ->excludes(imagined);
  command->add_option("--steps", arguments->steps, "with --imagined: calls of the network per chunk")
      ->check(CLI::Range(2, 1000))
      ->capture_default_str()
      ->needs(imagined);
  command->footer(
      "Example:\n"
      "  evac encode out/shards --config apps/configs/desk_model.yaml --codec out/codec/codec.safetensors\n"
      "  evac encode out/shards --config apps/configs/desk_model.yaml --codec out/world/weights.safetensors --imagined "
      "out/imagined\n"
      "Latents that are there, of this codec and these shards, are not made again.");
  command->callback([arguments, &exit_code] {
    exit_code = arguments->imagined.empty() ? Encode(*arguments) : Imagine(*arguments);
  });
}

}  // namespace evac
