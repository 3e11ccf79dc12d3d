#pragma once

#include "worldmodel/nn/tensor.h"

namespace evac::nn {

/// The tensors of a file as libtorch's, without a copy. libtorch counts who uses the file's bytes, so the file stays
/// open until the last of its tensors is gone. They are read-only by agreement: writing to one ends the process.
class MappedTensors {
 public:
  explicit MappedTensors(TensorFile file);

  const TensorFile& file() const { return *file_; }
  /// A copy only where the bytes do not lie as the type wants.
  /// @throws TensorError naming file and tensor if it is not there.
  Tensor Get(const std::string& name) const;

 private:
  const TensorFile* file_;  ///< lives as long as storage_
  at::Storage storage_;     ///< all bytes of the file
};

/// The system may forget the pages of a tensor of MappedTensors after it was copied or packed; reading it again costs a
/// disk access, no more. Does nothing to any other tensor.
void LetGo(const Tensor& tensor);

}  // namespace evac::nn
