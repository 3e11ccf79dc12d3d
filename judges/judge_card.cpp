#include "judges/judge_card.h"

#include <cstddef>

#include "core/hash.h"

namespace evac {
namespace {

constexpr std::size_t kDigits = 12;

}  // namespace

std::int64_t LooksOnCard(const WeightFile& file) { return file.card().contains("looks") ? file.Whole("looks", 1, 16) : 1; }

std::string ClassifierName(const std::filesystem::path& weights) { return "classifier:" + Sha256HexOfFile(weights).substr(0, kDigits); }

std::string ClipMark(const std::string& video_sha256) { return video_sha256.substr(0, kDigits); }

}  // namespace evac
