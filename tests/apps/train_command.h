#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "apps/commands.h"
#include "apps/network_parts.h"
#include "core/file.h"
#include "tests/apps/learning_shards.h"
#include "tests/apps/printed.h"
#include "tests/support/temp_folder.h"

namespace evac {

/// A network for LearningShards and their codec.
inline constexpr const char* kPage = R"(
chunk: 2
memory: 2
views: 2
image_height_px: 16
image_width_px: 24
schedule: {steps: 1000}
unet: {in_channels: 31, out_channels: 8, model_channels: 32, channel_mult: [1], num_res_blocks: 1,
       attention_resolutions: [1], num_head_channels: 16, context_dim: 32, init_attention_heads: 2}
vae: {channels: 32, channel_mult: [1, 1], num_res_blocks: 1, z_channels: 8, scale_factor: 1, patch_px: 2}
action_resampler: {embedding_dim: 14, queries: 3, dim: 32, depth: 1, dim_head: 16, heads: 2, output_dim: 32}
image_resampler: {embedding_dim: 32, queries: 4, dim: 32, depth: 1, dim_head: 16, heads: 2, output_dim: 32}
image_encoder: {width: 32, layers: 1, head_width: 16, patch_px: 14, image_px: 28, embed_dim: 16, vocabulary: 8}
)";

class TrainCommand : public testing::Test {
 protected:
  TrainCommand() {
    WriteLearningShards(folder_ / "shards", {.clips = 4, .frames = 6});
    WriteFileAtomically(Path("page.yaml"), kPage);
  }
  std::string Path(const std::string& name) const { return (folder_ / name).string(); }
  void Replace(const std::string& name, const std::string& old, const std::string& text) const {
    std::string page = ReadFile(Path(name));
    for (std::size_t at = page.find(old); at != std::string::npos; at = page.find(old, at + text.size()))
      page.replace(at, old.size(), text);
    WriteFileAtomically(Path(name), page);
  }
  /// What `evac train …` prints; its exceptions come through.
  static std::string Train(const std::vector<std::string>& more) {
    std::vector<std::string> words = {"train"};
    words.insert(words.end(), more.begin(), more.end());
    return Printed(AddTrain, words);
  }
  /// Latents of the codec that TrainCodec made, beside the shards.
  void Encode() const {
    Printed(AddEncode, {"encode", Path("shards"), "--config", Path("page.yaml"), "--codec",
                        Path("codec/codec.safetensors")});
  }
  std::string TrainCodec(const std::vector<std::string>& more = {}) const {
    std::vector<std::string> words = {"codec", Path("shards"), "--config", Path("page.yaml"), "--out", Path("codec"),
                                      "--set", "batch=2",      "--steps",  "1"};
    words.insert(words.end(), more.begin(), more.end());
    return Train(words);
  }

  const TempFolder folder_;
};

}  // namespace evac
