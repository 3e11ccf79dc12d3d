#include "apps/networks/codec_identity.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <map>

#include "core/hash.h"
#include "core/tensor_file.h"
#include "worldmodel/train/weight_files.h"

namespace evac {

std::string CodecSha256(const std::filesystem::path& weights) {
  const TensorFile file = TensorFile::OpenCheckpoint(weights);
  std::map<std::string, const TensorView*> codec;
  for (const TensorView& tensor : file.tensors()) {
    if (tensor.name.starts_with(train::kCodecPrefix)) codec[tensor.name] = &tensor;
  }
  if (codec.empty()) throw TensorError(fmt::format("{}: no tensor begins with {}: it holds no codec", weights.string(), train::kCodecPrefix));
  std::string all;
  for (const auto& [name, tensor] : codec) {
    all += fmt::format("{} {} {}\n", name, Name(tensor->type), fmt::join(tensor->shape, ","));
    all.append(reinterpret_cast<const char*>(tensor->bytes.data()), tensor->bytes.size());
  }
  return Sha256Hex(all);
}

}  // namespace evac
