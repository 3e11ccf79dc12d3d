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
  /// @returns a verdict with the judge's name; what goes wrong is a verdict `invalid` with the reason, never a failure.
  virtual Verdict Rate(const Task& task, const Episode& episode) = 0;
};

}  // namespace evac
