#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/config.h"

namespace evac {

/// What a suite says of a world of type `evac` (docs/evac_world.md). The harness knows no networks: apps/factory makes
/// one of it.
struct SuiteEvac {
  std::filesystem::path weights;                    ///< .safetensors or .pt
  std::filesystem::path config;                     ///< the page of the network's sizes
  /// The robot's page; none: the weights' own, AgiBot World's if they hold none.
  std::optional<std::filesystem::path> statistics;
  std::string solver = "ddim";                      ///< ddim or dpm
  int steps = 27;                                   ///< times the network is asked per chunk
  double eta = 1;                                   ///< of ddim
  double cfg = 1, cfg_rescale = 0.7;                ///< guidance; 1: none
  double period_s = 0.1;                            ///< between two frames, as the network was trained
  bool pose_map_scales = false;                     ///< discs and axes in parts of the picture, not in pixels
  bool all_threads_per_scene = false;
  bool bf16 = false;  ///< weights, products and the values between layers; else floats
  std::vector<std::string> quirks;                    ///< of the reference, by name (docs/evac_quirks.md)
  std::optional<std::filesystem::path> cache_folder;  ///< of imagined chunks
  double cache_limit_gb = 10;
  std::string weights_sha256;  ///< of the file, when the page was read
  std::string hash;  ///< SHA-256 of everything above that decides a frame: files by content
};

/// @param page  an item of `worlds` with `type: evac`
/// @throws InvalidInput naming file, line, field, what was found and what was wanted; also if a file is not there.
SuiteEvac ReadSuiteEvac(const Config& page);

/// Between the reading of a suite and a world's turn lie hours: what was loaded is to be what `hash` says. To be called
/// after the files were read, so that what was written to meanwhile is noticed too.
/// @throws InvalidInput naming the file and both hashes if the weights, the page or the statistics are others by now.
void DemandUnchanged(const SuiteEvac& evac);

/// Whether a line of the suite's canonical text is hashed by content (its files) or decides nothing (the cache).
bool IsHashedByContent(const std::string& canonical_line);

}  // namespace evac
