#include <ATen/ops/isfinite.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>

#include "tests/fuzz/mutate_tensor_file.h"
#include "tests/fuzz/scratch.h"
#include "tests/fuzz/small_shards.h"
#include "worldmodel/train/shards.h"

namespace {

using evac::train::Shard;
using evac::train::ShardSet;
using evac::train::Split;
using evac::train::Tensor;

void Require(bool is_so) {
  if (!is_so) std::abort();
}

/// What the first byte says the others are; each kind has a folder in which the rest is right.
constexpr std::array kFiles = {"shard_00000.safetensors", "latents_00000.safetensors", "variants_00000.safetensors",
                               "shards.json"};

std::filesystem::path FolderOf(const Scratch& scratch, std::size_t kind) { return scratch.folder() / kFiles[kind]; }

/// One for all inputs.
const Scratch& Folders() {
  static const Scratch scratch;
  static const bool is_written = [] {
    for (std::size_t kind = 0; kind < kFiles.size(); ++kind) WriteSmallShards(FolderOf(scratch, kind));
    return true;
  }();
  Require(is_written);
  return scratch;
}

/// Every byte of rows that are said to be there is.
void ReadRows(const Tensor& tensor, std::int64_t first, std::int64_t count) {
  Require(tensor.defined() && tensor.dim() > 0 && first >= 0 && count > 0 && first <= tensor.size(0) - count);
  const Tensor rows = tensor.narrow(0, first, count);
  Require(rows.is_contiguous() && reinterpret_cast<std::uintptr_t>(rows.data_ptr()) % rows.element_size() == 0);
  const auto* bytes = static_cast<const volatile std::uint8_t*>(rows.data_ptr());
  for (std::size_t i = 0; i < rows.nbytes(); ++i) static_cast<void>(bytes[i]);
}

void ReadFinite(const Tensor& tensor, std::int64_t first, std::int64_t count) {
  ReadRows(tensor, first, count);
  Require(tensor.narrow(0, first, count).isfinite().all().item<bool>());
}

void WalkClips(const ShardSet& set) {
  const std::string tasks = set.metadata().at("tasks");
  const auto task_count = 1 + std::count(tasks.begin(), tasks.end(), ',');
  Require(!set.shards().empty() && !set.clips().empty() && set.frame_count() > 0);
  Require(set.views() > 0 && set.height_px() > 0 && set.width_px() > 0);
  for (const evac::train::Clip& clip : set.clips()) {
    Require(clip.shard < set.shards().size() && clip.task >= 0 && clip.task < task_count);
    Require(clip.outcome >= -1 && clip.outcome <= 1);
    const Shard& shard = set.shards()[clip.shard];
    for (const Tensor& tensor : {shard.frames, shard.maps, shard.object_px, shard.contact})
      ReadRows(tensor, clip.first, clip.frames);
    for (const Tensor& tensor : {shard.actions, shard.deltas, shard.c2w, shard.k})
      ReadFinite(tensor, clip.first, clip.frames);
    const Tensor picture = evac::train::PicturesFrom(shard.frames[clip.first]);
    Require(picture.size(0) == set.views() && picture.size(3) == set.width_px());
  }
}

void WalkLatents(ShardSet& set) {
  set.OpenLatents(kSmallLatentChannels, kSmallLatentStride, kSmallScaleFactor);
  for (const evac::train::Clip& clip : set.clips()) {
    ReadRows(set.shards()[clip.shard].latents, clip.first, clip.frames);
    ReadRows(set.shards()[clip.shard].map_latents, clip.first, clip.frames);
  }
  Require(!set.products().empty() && set.LatentsIdentity().starts_with(set.codec()));
}

void WalkVariants(ShardSet& set) {
  set.OpenVariants();
  for (const evac::train::Variant& variant : set.variants()) {
    Require(variant.shard < set.shards().size() && variant.outcome >= -1 && variant.outcome <= 1);
    const Shard& shard = set.shards()[variant.shard];
    ReadRows(shard.frames, variant.picture, 1);
    ReadFinite(shard.variant_actions, variant.first, variant.frames);
    ReadRows(shard.variant_object_px, variant.first, variant.frames);
  }
}

template <typename Function>
void ReadOrRefuse(Function read) {
  try {
    read();
  } catch (const evac::TensorError&) {
  }
}

}  // namespace

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t max_size);

/// Every other time a file of tensors that is one still.
extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size, std::size_t max_size,
                                               unsigned seed) {
  if (size > 1 && seed % 2 == 0) {
    const std::string file(reinterpret_cast<const char*>(data) + 1, size - 1),
        mutated = MutatedTensorFile(file, seed, max_size - 1);
    std::memcpy(data + 1, mutated.data(), mutated.size());
    if (!mutated.empty()) return 1 + mutated.size();
  }
  return LLVMFuzzerMutate(data, size, max_size);
}

/// Any bytes are one file of a packing, all of whose clips, latents and variants can then be read, or a TensorError.
/// The first byte says which file.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const std::size_t kind = data[0] % kFiles.size();
  const std::filesystem::path folder = FolderOf(Folders(), kind);
  Folders().Write(std::string(kFiles[kind]) + "/" + kFiles[kind], data + 1, size - 1);
  for (const Split split : {Split::kTrain, Split::kHoldout}) {
    if (kind > 0 && split == Split::kHoldout) break;  // of files that are right
    ReadOrRefuse([&] {
      ShardSet set(folder, split);
      Require(evac::train::HasSplit(folder, split));
      WalkClips(set);
      ReadOrRefuse([&] { WalkLatents(set); });
      ReadOrRefuse([&] { WalkVariants(set); });
    });
  }
  return 0;
}
