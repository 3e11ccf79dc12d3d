#include <ATen/core/Dict.h>
#include <ATen/ops/equal.h>
#include <gtest/gtest.h>
#include <torch/csrc/jit/serialization/pickle.h>

#include "tests/nn/support.h"
#include "worldmodel/nn/mapped_tensors.h"

namespace evac::nn {
namespace {

/// libtorch's own pickler writes, our reader reads.
TEST(TorchFile, TensorsThatLibtorchSavedAreRead) {
  const Tensor plain = Noise({3, 4, 5}, 1), turned = Noise({6, 4}, 2).transpose(0, 1);
  const std::vector<std::pair<std::string, Tensor>> tensors = {
      {"plain", plain},
      {"turned", turned},
      {"part", plain.select(1, 2)},
      {"channels_last", Noise({2, 8, 3, 3}, 3).contiguous(at::MemoryFormat::ChannelsLast)},
      {"half", plain.to(at::kHalf)},
      {"bf16", plain.to(at::kBFloat16)},
      {"double", plain.to(at::kDouble)},
      {"whole", at::arange(5, at::kLong)},
      {"number", Noise({}, 4)},
      {"empty", at::empty({0, 3}, at::kFloat)}};
  c10::Dict<std::string, Tensor> dict;
  for (const auto& [name, tensor] : tensors) dict.insert(name, tensor);
  const std::vector<char> bytes = torch::jit::pickle_save(dict);
  const MappedTensors read(TensorFile::ParseTorch({bytes.begin(), bytes.end()}, "saved"));
  EXPECT_EQ(read.file().tensors().size(), tensors.size());
  for (const auto& [name, tensor] : tensors) {
    EXPECT_EQ(read.Get(name).scalar_type(), tensor.scalar_type()) << name;
    EXPECT_TRUE(at::equal(read.Get(name), tensor)) << name;
  }
}

}  // namespace
}  // namespace evac::nn
