#pragma once

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <string>

namespace evac {

/// For options that are numbers with a fraction: a finite one from `least` to `most`. CLI::Range lets `nan` pass, which
/// is neither below nor above anything.
inline CLI::Validator Within(double least, double most) {
  const auto complaint = [least, most](const std::string& word) -> std::string {
    double found = 0;
    const bool is_within = CLI::detail::lexical_cast(word, found) && found >= least && found <= most;
    return is_within ? "" : fmt::format("Value {} not in range {:g} to {:g}", word, least, most);
  };
  return {complaint, fmt::format("FLOAT in [{:g} - {:g}]", least, most)};
}

}  // namespace evac
