#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <future>
#include <memory>
#include <thread>
#include <vector>

#include "apps/commands.h"
#include "apps/network_parts.h"
#include "apps/networks/codec_identity.h"
#include "core/hash.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/threads.h"
#include "worldmodel/train/encode_shards.h"
#include "worldmodel/train/trainable_weights.h"
#include "worldmodel/train/weight_files.h"

namespace evac {
namespace {

struct EncodeArguments {
  std::string shards, config, codec;
  int threads = 0;
  bool bf16 = false;
};

int ThreadsOf(const EncodeArguments& arguments) {
  const auto cores = static_cast<int>(std::thread::hardware_concurrency());
  return arguments.threads > 0 ? arguments.threads : std::max(1, cores);
}

ExitCode Encode(const EncodeArguments& arguments) {
  const nn::ModelConfig config = ReadEvacConfig(arguments.config);
  train::CheckpointWeights file(arguments.codec);
  train::TrainableWeights weights(file, arguments.bf16 ? at::kBFloat16 : at::kFloat);
  const nn::Vae vae(nn::Scope(weights, train::kCodecPrefix), config.vae);
  const std::string codec = CodecSha256(arguments.codec);
  const std::vector<std::filesystem::path> shards = train::ShardPaths(arguments.shards);
  const nn::LibraryThreads one_each(1);
  std::atomic<std::size_t> next = 0, encoded = 0;
  // Each thread takes a shard of its own: threads that share a picture's layers wait for each other after each of them.
  const auto work = [&] {
    nn::UseLibraryThreadsHere(1);
    for (std::size_t i = next++; i < shards.size(); i = next++) {
      const train::EncodeOptions options{codec, Sha256HexOfFile(shards[i]), arguments.bf16 ? "bfloat16" : "float32"};
      if (train::IsEncoded(shards[i], options)) continue;
      train::EncodeShard(vae, shards[i], options);
      fmt::print(stderr, "{}: encoded, {} of {}\n", train::LatentsPath(shards[i]).string(), ++encoded, shards.size());
    }
  };
  std::vector<std::future<void>> others;
  for (int thread = 1; thread < ThreadsOf(arguments); ++thread)
    others.push_back(std::async(std::launch::async, work));
  work();
  for (std::future<void>& other : others) other.get();
  fmt::print("{}: latents of {} shards, {} of them new\n", arguments.shards, shards.size(), encoded.load());
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
  command->footer(
      "Example:\n"
      "  evac encode out/shards --config apps/configs/desk_model.yaml --codec out/codec/codec.safetensors\n"
      "Latents that are there, of this codec and these shards, are not made again.");
  command->callback([arguments, &exit_code] { exit_code = Encode(*arguments); });
}

}  // namespace evac
