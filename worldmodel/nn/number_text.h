#pragma once

#include <charconv>
#include <cmath>
#include <cstdio>
#include <string>
#include <system_error>
#include <type_traits>

/// Numbers and flags as jobs, sizes and settings have them in their text.
namespace evac::nn {

/// All of the text as a number; of those that are no whole ones a finite one.
/// @returns false, with `number` as it was, if the text says no such thing
template <typename Number>
  requires(std::is_arithmetic_v<Number> && !std::is_same_v<Number, bool>)
bool ParseNumber(const std::string& text, Number& number) {
  Number found{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), found);
  if (error != std::errc() || end != text.data() + text.size()) return false;
  if constexpr (std::is_floating_point_v<Number>) {
    if (!std::isfinite(found)) return false;
  }
  number = found;
  return true;
}

/// "true" or "false". @returns false, with `flag` as it was, for anything else
inline bool ParseFlag(const std::string& text, bool& flag) {
  if (text != "true" && text != "false") return false;
  flag = text == "true";
  return true;
}

/// With all its digits: read again it is the same number.
inline std::string TextOfNumber(double number) {
  char text[40];
  std::snprintf(text, sizeof text, "%.17g", number);
  return text;
}

}  // namespace evac::nn
