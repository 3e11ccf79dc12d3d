#pragma once

#include <deque>
#include <filesystem>
#include <memory>

#include "apps/networks/relu_weights.h"
#include "worldmodel/train/train_codec.h"
#include "worldmodel/train/trainable_weights.h"
#include "worldmodel/train/weight_files.h"

namespace evac {

/// Copies of one small network (judge, policy) that are trained side by side, each in its thread; the first is the one
/// that is measured and written.
template <class Net>
class Learners {
 public:
  /// @param shape  what `Net` is made from, beside its parameters
  /// @param init   weights to begin with, every parameter of which must fit; empty: drawn from the seed
  template <class Shape>
  Learners(const Shape& shape, std::uint64_t seed, std::int64_t count, const std::filesystem::path& init = {}) {
    for (std::int64_t i = 0; i < count; ++i) copies_.emplace_back(shape, seed, init);
  }

  const Net& net() const { return copies_.front().net; }
  const train::TrainableWeights& weights() const { return copies_.front().weights; }
  std::size_t count() const { return copies_.size(); }

  /// @param loss  (const Net&, const train::StepPlace&) → the loss; outlives the trainer
  template <class Loss>
  void Replicate(train::Trainer& trainer, const Loss& loss) const {
    for (std::size_t i = 1; i < copies_.size(); ++i)
      trainer.AddReplica({copies_[i].weights.all(),
                          [&copy = copies_[i], &loss](const train::StepPlace& at) { return loss(copy.net, at); }});
  }

  /// Writes the first copy's weights, floats, with a card.
  void Write(const std::filesystem::path& path, const TensorMetadata& card) const {
    std::vector<TensorView> views;
    for (const train::NamedTensor& weight : weights().all())
      views.push_back(nn::ViewOf(weight.name, weight.tensor.detach()));
    WriteTensorFile(path, views, card);
  }

 private:
  struct Copy {
    template <class Shape>
    Copy(const Shape& shape, std::uint64_t seed, const std::filesystem::path& init)
        : random(seed),
          given(init.empty() ? nullptr : std::make_unique<train::CheckpointWeights>(init)),
          weights(given ? static_cast<nn::ParameterSource&>(*given) : random),
          net(shape, [this](const std::string& key, const std::vector<std::int64_t>& sizes) {
            return weights.Take(key, sizes);
          }) {}
    Copy(const Copy&) = delete;
    Copy& operator=(const Copy&) = delete;

    ReluWeights random;
    std::unique_ptr<train::CheckpointWeights> given;
    train::TrainableWeights weights;
    Net net;
  };
  std::deque<Copy> copies_;
};

}  // namespace evac
