#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "worldmodel/imaginer.h"
#include "worldmodel/nn/model_config.h"

namespace evac {

/// A chunk as it was imagined.
struct FinishedChunk {
  ChunkLatents latents;
  Pictures pictures;  ///< [count][V], the network's size
};

/// OUT/chunks: what was imagined so far, a file per chunk (chunk_00000.safetensors), so that a run goes on where it was
/// killed. Each says which job it is of and carries a hash of its numbers.
class ChunkFolder {
 public:
  /// @param job  the hash of everything that decides the frames
  ChunkFolder(std::filesystem::path folder, std::string job, const nn::ModelConfig& config);

  /// The chunk of that index with so many frames; nothing if it is not there. One that is spoiled, or another job's,
  /// counts as not there; `warning` then says why.
  std::optional<FinishedChunk> Load(std::size_t index, std::size_t count, std::string& warning) const;
  /// Whole or not at all. @throws Error (the disk is full).
  void Save(std::size_t index, const FinishedChunk& chunk) const;

 private:
  std::filesystem::path FileOf(std::size_t index) const;
  std::string KeyOf(std::size_t index, std::size_t count) const;

  std::filesystem::path folder_;
  std::string job_;
  nn::ModelConfig config_;
};

}  // namespace evac
