#include "apps/networks/codec_identity.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <map>

#include "core/hash.h"
#include "worldmodel/nn/mapped_tensors.h"
#include "worldmodel/train/weight_files.h"

namespace evac {

std::string CodecSha256(const std::filesystem::path& weights) {
  const nn::MappedTensors tensors(TensorFile::OpenCheckpoint(weights));
  std::map<std::string, at::Tensor> codec;
  for (const TensorView& tensor : tensors.file().tensors()) {
    if (tensor.name.starts_with(train::kCodecPrefix))
      codec[tensor.name] = tensors.Get(tensor.name).to(at::kFloat).contiguous();
  }
  if (codec.empty())
    throw TensorError(fmt::format("{}: no tensor begins with {}: it holds no codec", weights.string(), train::kCodecPrefix));
  std::string all;
  for (const auto& [name, tensor] : codec) {
    all += fmt::format("{} {}\n", name, fmt::join(tensor.sizes().vec(), ","));
    all.append(static_cast<const char*>(tensor.data_ptr()), tensor.nbytes());
  }
  return Sha256Hex(all);
}

}  // namespace evac
