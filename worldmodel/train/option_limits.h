#pragma once

#include <cmath>
#include <cstdio>
#include <initializer_list>
#include <string>
#include <utility>

#include "worldmodel/nn/tensor.h"

/// What the numbers of a training's options may be. One out of range would be taken for another, or for nothing at all,
/// and hours later nobody sees it. What is no number is refused too.
namespace evac::train {

/// An option of a training that is out of range, by name: whoever read it from a page knows where it stands there.
class OptionError : public TensorError {
 public:
  /// @param training  whose option it is, e.g. "world training"
  /// @param found     "is 4, wanted 0 to 1"
  OptionError(const std::string& training, std::string option, const std::string& found)
      : TensorError(training + ": " + option + " " + found), option_(std::move(option)) {}
  const std::string& option() const { return option_; }

 private:
  std::string option_;
};

struct NamedNumber {
  const char* name;
  double value;
};

/// @param training  whose options they are, e.g. "world training"
/// @throws OptionError naming it, the option, what was found and what was wanted; as all of these do
[[noreturn]] inline void RefuseOption(const char* training, const NamedNumber& option, const char* wanted) {
  char found[32];
  std::snprintf(found, sizeof found, "%g", option.value);
  throw OptionError(training, option.name, std::string("is ") + found + ", wanted " + wanted);
}

/// Parts of a whole: 0 to 1.
inline void RequireShares(const char* training, std::initializer_list<NamedNumber> options) {
  for (const NamedNumber& option : options) {
    if (!(option.value >= 0 && option.value <= 1)) RefuseOption(training, option, "0 to 1");
  }
}

/// Weights and deviations: 0 or more, and finite.
inline void RequireWeights(const char* training, std::initializer_list<NamedNumber> options) {
  for (const NamedNumber& option : options) {
    if (!(option.value >= 0 && std::isfinite(option.value))) RefuseOption(training, option, "0 or more, and finite");
  }
}

/// What is divided by, and bounds of which 0 would leave nothing.
inline void RequireAboveZero(const char* training, std::initializer_list<NamedNumber> options) {
  for (const NamedNumber& option : options) {
    if (!(option.value > 0)) RefuseOption(training, option, "above 0");
  }
}

}  // namespace evac::train
