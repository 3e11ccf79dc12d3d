#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/weight_file.h"

/// What a judge's weights and the clips that it learned from are called on cards and in verdicts.
namespace evac {

inline constexpr const char* kClassifierFormat = "evac-classifier 1";

/// How many places a classifier looks at in each picture: the card's `looks`, 1 where it says nothing.
std::int64_t LooksOnCard(const WeightFile& file);

/// "classifier:" and the first 12 digits of the weights' SHA-256: other weights, or another card, are another judge.
std::string ClassifierName(const std::filesystem::path& weights);

/// A clip in a card's `learned_from`: the first 12 digits of its SHA-256. A judge does not rate such a clip.
std::string ClipMark(const std::string& video_sha256);

}  // namespace evac
