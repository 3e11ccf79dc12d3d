#include "apps/networks/judge_widen.h"

#include <deque>

#include "apps/networks/relu_weights.h"
#include "core/weight_file.h"
#include "judges/judge_card.h"
#include "worldmodel/train/weight_files.h"

namespace evac {
namespace {

/// Parameters of the new judge: those of the given one where they fit, with nothing behind what it has, or drawn.
class Widened {
 public:
  Widened(const std::filesystem::path& from, std::int64_t looks_before, std::int64_t looks, std::uint64_t seed)
      : given_(from), drawn_(seed), looks_before_(looks_before), looks_(looks) {}

  at::Tensor Take(const std::string& key, const std::vector<std::int64_t>& shape) {
    if (!given_.file().Has(key)) return drawn_.Take(key, shape);  // where a new look looks
    const std::vector<std::int64_t>& before = given_.file().Get(key).shape;
    if (before == shape) return given_.Take(key, shape);
    const at::Tensor old = given_.Take(key, before);
    return key == "hidden.weight" ? Hidden(old, shape) : Longer(old, shape, 0);
  }

 private:
  /// With zeros behind, along one dimension.
  static at::Tensor Longer(const at::Tensor& old, std::vector<std::int64_t> shape, std::int64_t dimension) {
    shape[static_cast<std::size_t>(dimension)] -= old.size(dimension);
    return at::cat({old, at::zeros(shape)}, dimension);
  }

  /// What each view saw is as many columns for each look, then those of the look at the whole; the task's come last.
  at::Tensor Hidden(const at::Tensor& old, const std::vector<std::int64_t>& shape) const {
    const ClassifierColumns columns = ColumnsOfAView();
    const std::int64_t view_before = looks_before_ * columns.look + columns.whole;
    std::vector<at::Tensor> parts;
    std::int64_t at = 0;
    for (; at + view_before <= old.size(1); at += view_before) {
      parts.push_back(Longer(old.narrow(1, at, looks_before_ * columns.look), {shape[0], looks_ * columns.look}, 1));
      parts.push_back(old.narrow(1, at + looks_before_ * columns.look, columns.whole));
    }
    parts.push_back(old.narrow(1, at, old.size(1) - at));
    return at::cat(parts, 1).reshape(shape);
  }

  train::CheckpointWeights given_;
  ReluWeights drawn_;
  std::int64_t looks_before_, looks_;
};

}  // namespace

void WidenJudge(const std::filesystem::path& from, const ClassifierShape& shape, std::uint64_t seed, const std::filesystem::path& to) {
  const WeightFile file(from, kClassifierFormat);
  Widened widened(from, LooksOnCard(file), shape.looks, seed);
  std::deque<at::Tensor> tensors;
  std::vector<TensorView> views;
  const ClassifierNet net(shape, [&](const std::string& key, const std::vector<std::int64_t>& sizes) {
    tensors.push_back(widened.Take(key, sizes).contiguous());
    views.push_back(nn::ViewOf(key, tensors.back()));
    return tensors.back();
  });
  WriteTensorFile(to, views, file.card());
}

}  // namespace evac
