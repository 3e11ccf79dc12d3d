#pragma once

#include <set>
#include <string>
#include <vector>

#include "worldmodel/nn/evac_model.h"

/// Which keys a checkpoint must have, may have and must not have.
namespace evac::nn {

/// Keys of the denoiser that lie in every checkpoint and that nothing reads (docs/weights.md): `to_k` and `to_v` of the
/// attention to the context, and of the pairs `*_ip` (image) and `*_tp` (actions) the one that a block does not listen
/// to.
std::set<std::string> DeadKeys(const std::vector<ParameterShape>& keys);

/// What is left of CLIP beside its visual tower, and of the tower what comes after its last block. Any of them may be
/// there, in any shape.
bool IsClipLeftover(const std::string& key);

/// How a file's tensors fit a network. Lists are in the network's order, `extra` in the file's.
struct KeyFit {
  std::vector<std::string> missing;
  std::vector<std::string> extra;
  std::vector<std::string> misshapen;  ///< "KEY is F32 [2, 3], wanted [3, 2]"
  std::vector<std::string> unread;     ///< in the file, and nothing reads them
  bool Fits() const { return missing.empty() && extra.empty() && misshapen.empty(); }
  /// "1 key is missing: a.weight; 12 keys are of no use: …"; the first ten of each. Empty if it fits.
  std::string Complaint() const;
};
KeyFit CompareKeys(const TensorFile& file, const ModelConfig& config);

}  // namespace evac::nn
