#pragma once

#include <string>

#include "core/types.h"

namespace evac {

/// Says whether a stored episode succeeded. Can be run at any time after it, any number of times.
class Judge {
 public:
  virtual ~Judge() = default;

  virtual std::string Name() const = 0;

  /// @param episode  as loaded from the store: arms, commands, video path, no images, no privileged track.
  /// @returns a verdict with the judge's name; what is wrong with the episode is a verdict `invalid` with the reason.
  /// @throws Error for what is not its doing (a full disk): it can be asked about again.
  virtual Verdict Rate(const Task& task, const Episode& episode) = 0;
};

}  // namespace evac
