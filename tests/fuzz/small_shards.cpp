#include "tests/fuzz/small_shards.h"

#include <cstring>
#include <deque>
#include <vector>

#include "core/file.h"
#include "core/tensor_file.h"

namespace {

constexpr std::int64_t kClips = 2, kRows = 4, kSide = 8, kLatentSide = kSide / kSmallLatentStride;

/// Tensors with their bytes.
class Tensors {
 public:
  /// @param numbers  what it holds, over and over
  template <typename Number>
  void Add(const std::string& name, evac::TensorType type, std::vector<std::int64_t> shape,
           const std::vector<Number>& numbers) {
    evac::TensorView view{{name, type, std::move(shape)}, {}};
    std::vector<std::byte>& bytes = bytes_.emplace_back(view.ByteCount());
    for (std::size_t i = 0; i < bytes.size() / sizeof(Number); ++i)
      std::memcpy(bytes.data() + i * sizeof(Number), &numbers[i % numbers.size()], sizeof(Number));
    view.bytes = bytes;
    views_.push_back(view);
  }
  void Write(const std::filesystem::path& path, const evac::TensorMetadata& metadata) const {
    evac::WriteTensorFile(path, views_, metadata);
  }

 private:
  std::deque<std::vector<std::byte>> bytes_;
  std::vector<evac::TensorView> views_;
};

using Bytes = std::vector<std::uint8_t>;
using Floats = std::vector<float>;
using Longs = std::vector<std::int64_t>;
using evac::TensorType;

void WriteShard(const std::filesystem::path& path, const std::string& split, const std::string& number) {
  Tensors tensors;
  tensors.Add("clip_start", TensorType::kI64, {kClips + 1}, Longs{0, 2, kRows});
  tensors.Add("task", TensorType::kI32, {kClips}, std::vector<std::int32_t>{0, 1});
  tensors.Add("outcome", TensorType::kI8, {kClips}, std::vector<std::int8_t>{1, -1});
  tensors.Add("frames", TensorType::kU8, {kRows, 1, kSide, kSide, 3}, Bytes{10, 120, 200});
  tensors.Add("maps", TensorType::kU8, {kRows, 1, kSide, kSide, 3}, Bytes{50});
  tensors.Add("actions", TensorType::kF32, {kRows, 16}, Floats{0.5F});
  tensors.Add("deltas", TensorType::kF32, {kRows, 14}, Floats{0});
  tensors.Add("c2w", TensorType::kF32, {kRows, 1, 4, 4}, Floats{1, 0, 0, 0, 0});
  tensors.Add("k", TensorType::kF32, {kRows, 1, 3, 3}, Floats{8, 0, 4, 0, 8, 4, 0, 0, 1});
  tensors.Add("object_px", TensorType::kF32, {kRows, 1, 2}, Floats{4});
  tensors.Add("contact", TensorType::kU8, {kRows}, Bytes{0, 1});
  tensors.Write(path, {{"format", "evac-shard"},
                       {"version", "1"},
                       {"split", split},
                       {"period_s", "0.1"},
                       {"height_px", std::to_string(kSide)},
                       {"width_px", std::to_string(kSide)},
                       {"cameras", "head"},
                       {"arms", "right"},
                       {"arms_read", "told"},
                       {"tasks", "push,lift"},
                       {"pose_map", "radius_px=10 thickness_px=2"},
                       {"delta_frames", "3"},
                       {"statistics", "none"},
                       {"recipe", "small"},
                       {"shard", number},
                       {"shards", "2"}});
}

void WriteLatents(const std::filesystem::path& path) {
  Tensors tensors;
  for (const char* name : {"latents", "map_latents"})
    tensors.Add(name, TensorType::kF16, {kRows, 1, kSmallLatentChannels, kLatentSide, kLatentSide}, Bytes{0, 0x3c});
  tensors.Write(path, {{"format", "evac-latents"},
                       {"version", "1"},
                       {"codec", "c"},
                       {"shard_sha256", "5a"},
                       {"products", "float32"},
                       {"scale_factor", std::to_string(kSmallScaleFactor).substr(0, 3)}});
}

void WriteVariants(const std::filesystem::path& path) {
  Tensors tensors;
  tensors.Add("clip", TensorType::kI64, {2}, Longs{0, 1});
  tensors.Add("start", TensorType::kI64, {3}, Longs{0, 2, 3});
  tensors.Add("actions", TensorType::kF32, {3, 16}, Floats{0.5F});
  tensors.Add("object_px", TensorType::kF32, {3, 1, 2}, Floats{4});
  tensors.Add("outcome", TensorType::kI8, {2}, std::vector<std::int8_t>{1, 0});
  tensors.Write(path, {{"format", "evac-variants"}, {"version", "1"}, {"recipe", "small"}});
}

}  // namespace

void WriteSmallShards(const std::filesystem::path& folder, const std::string& split) {
  std::filesystem::create_directories(folder);
  std::string list;
  for (const std::string number : {"0", "1"}) {
    const std::string ending = "0000" + number + ".safetensors";
    WriteShard(folder / ("shard_" + ending), number == "0" ? split : "holdout", number);
    WriteLatents(folder / ("latents_" + ending));
    WriteVariants(folder / ("variants_" + ending));
    list += (list.empty() ? "" : ", ") + (R"({"file": "shard_)" + ending + R"(", "sha256": "5a"})");
  }
  evac::WriteFileAtomically(folder / "shards.json", R"({"recordings": ["a"], "shards": [)" + list + "]}\n");
}
