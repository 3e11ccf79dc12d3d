#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "worldmodel/chunk_cache.h"
#include "worldmodel/conditioning.h"
#include "worldmodel/nn/imagine_options.h"

namespace evac::nn {
class EvacModel;
}

namespace evac {

/// What decides the frames, beside the weights.
struct ImaginerOptions {
  nn::ImagineOptions sampler;
  ConditioningOptions conditioning;
  /// Quirk decoded_start: from the second chunk on the image encoder sees the codec's version of the first frame.
  bool decoded_start = false;
  std::string device = "cpu";  ///< where the network's weights are: libtorch's name

  /// What else decides the frames, for the cache: hashes of weights and configuration, device, number type, threads.
  std::string identity;
  std::optional<ChunkCacheOptions> cache;  ///< wants an identity
};

/// The frames of one chunk as latents.
struct ChunkLatents {
  std::vector<std::vector<float>> frames;  ///< [count][V, z, h, w]
  std::string key;                         ///< in the cache, if there is one
  Pictures pictures = {};                  ///< what the cache knows them to decode to; else empty
};

/// The network at work: four steps make one chunk (EVAC, Sec. 3), for EvacWorld and for `evac imagine`.
///
///   ImaginedScene scene = imaginer.Begin(start, seed);
///   for (each chunk of 1 … K targets) {
///     const auto memory = imaginer.Remember(scene);
///     const auto conditioning = imaginer.Condition(scene, memory, targets);
///     const auto latents = imaginer.Denoise(scene, conditioning);      // check WhatIsWrong(latents)
///     const auto pictures = imaginer.Decode(latents);
///     imaginer.Append(scene, targets, latents, pictures);
///   }
///
/// Const throughout: several threads may work on several scenes at once. Noise is a function of the scene's seed, the
/// camera's name, the number of frames before, the step and the element, so a scene's frames depend on nothing else.
class Imaginer {
 public:
  /// @throws InvalidInput for a cache without an identity, or whose folder cannot be made.
  Imaginer(std::unique_ptr<const nn::EvacModel> model, ImaginerOptions options);
  Imaginer(Imaginer&&) noexcept;
  Imaginer& operator=(Imaginer&&) noexcept;
  ~Imaginer();

  const nn::ModelConfig& config() const;
  const ImaginerOptions& options() const { return options_; }
  std::size_t chunk() const { return static_cast<std::size_t>(config().chunk); }  ///< K

  /// A scene that starts from one picture per camera, of any size: resized as in training, encoded once, and remembered
  /// N times. @throws InvalidInput unless there are V cameras, each with an image of its size.
  ImaginedScene Begin(const InitialScene& start, std::uint64_t seed) const;

  /// Which frames the network sees again: sparse, newest last.
  std::vector<std::size_t> Remember(const ImaginedScene& scene) const;

  /// Deltas, pose maps and rays. @param targets  1 … K
  ChunkConditioning Condition(const ImaginedScene& scene, std::vector<std::size_t> memory,
                              std::span<const Arms> targets) const;

  /// Encodes the maps, and denoises; or finds in the cache what comes of it. @returns latents of the
  /// `conditioning.count` frames that were asked for
  ChunkLatents Denoise(const ImaginedScene& scene, const ChunkConditioning& conditioning) const;

  /// To be called with finite latents (WhatIsWrong); then the cache keeps both.
  /// @returns [count][V] RGB, 8 bit, of the network's size. @throws InternalError if the codec's numbers are not
  /// finite.
  Pictures Decode(const ChunkLatents& latents) const;

  /// Remembers what was executed. @param targets  one per frame
  void Append(ImaginedScene& scene, std::span<const Arms> targets, ChunkLatents latents,
              const Pictures& pictures) const;

 private:
  ChunkLatents DenoiseAnew(const ImaginedScene& scene, const ChunkConditioning& conditioning) const;
  Pictures DecodeAnew(const ChunkLatents& latents) const;

  std::unique_ptr<const nn::EvacModel> model_;
  ImaginerOptions options_;
  std::unique_ptr<ChunkCache> cache_;  ///< or none
};

/// How the numbers went astray, as a sentence, or nothing.
std::optional<std::string> WhatIsWrong(const ChunkLatents& latents);

}  // namespace evac
