#include "worldmodel/trained_for.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "core/config.h"
#include "core/names.h"

namespace evac {
namespace {

constexpr double kPeriodTolerance_s = 1e-6;
constexpr double kStatisticsTolerance = 1e-6;  ///< relative: pages hold every digit, people who copy them do not

constexpr const char* kNumbers[] = {"left x",     "left y",  "left z",  "left roll",  "left pitch",  "left yaw",
                                    "right x",    "right y", "right z", "right roll", "right pitch", "right yaw"};

std::string Said(const TensorMetadata& metadata, const std::string& key) {
  const auto found = metadata.find(key);
  return found == metadata.end() ? std::string() : found->second;
}

double Period(const std::string& weights, const std::string& text) {
  char* end = nullptr;
  const double period_s = std::strtod(text.c_str(), &end);
  if (end != text.c_str() + text.size() || !std::isfinite(period_s) || period_s <= 0)
    throw InvalidInput("{}: metadata period_s: found '{}', wanted seconds, more than 0", weights, text);
  return period_s;
}

/// @param spread  beside which the two count: means of rounding noise are as good as 0
bool Differ(double one, double other, double spread = 0) {
  return std::abs(one - other) > kStatisticsTolerance * std::max({std::abs(one), std::abs(other), spread});
}

/// The first number that differs, in words; empty: none does.
std::string Difference(const ActionStatistics& page, const ActionStatistics& trained) {
  for (std::size_t i = 0; i < page.mean.size(); ++i) {
    const bool spread = Differ(page.deviation[i], trained.deviation[i]);
    if (!spread && !Differ(page.mean[i], trained.mean[i], trained.deviation[i])) continue;
    return fmt::format("{} of {}: found {:.6g}, wanted {:.6g}", spread ? "deviation" : "mean", kNumbers[i],
                       spread ? page.deviation[i] : page.mean[i], spread ? trained.deviation[i] : trained.mean[i]);
  }
  return "";
}

}  // namespace

TrainedFor TrainedFor::Of(const std::string& weights, const TensorMetadata& metadata) {
  TrainedFor trained;
  trained.weights = weights;
  if (const std::string period = Said(metadata, "period_s"); !period.empty())
    trained.period_s = Period(weights, period);
  trained.cameras = NamesIn(Said(metadata, "cameras"));
  trained.arms = NamesIn(Said(metadata, "arms"));
  if (const std::string page = Said(metadata, "statistics"); !page.empty())
    trained.statistics = ParseActionStatistics(page, weights + ": metadata statistics");
  trained.pose_map = Said(metadata, "pose_map");
  trained.arms_read = Said(metadata, "arms_read");
  return trained;
}

TrainedFor TrainedFor::Read(const std::filesystem::path& weights) {
  return Of(weights.string(), TensorFile::OpenCheckpoint(weights).metadata());
}

ActionStatistics TrainedFor::StatisticsOr(const std::optional<std::filesystem::path>& page) const {
  if (!page) return statistics ? *statistics : AgiBotWorldStatistics();
  ActionStatistics given = ReadActionStatistics(*page);
  const std::string difference = statistics ? Difference(given, *statistics) : "";
  if (!difference.empty())
    throw InvalidInput("{}: not the statistics that {} was trained with: {}; leave the page out to take the weights' own",
                       page->string(), weights, difference);
  return given;
}

void TrainedFor::CheckStatistics(const ActionStatistics& asked, const std::string& who) const {
  const std::string difference = statistics ? Difference(asked, *statistics) : "";
  if (!difference.empty())
    throw InvalidInput("{}: not the statistics that {} was trained with: {}", who, weights, difference);
}

void TrainedFor::CheckPeriod(double asked_period_s, const std::string& who) const {
  if (!period_s || std::abs(*period_s - asked_period_s) <= kPeriodTolerance_s) return;
  throw InvalidInput("{}: frames {:.7g} s apart are asked for, {} was trained with frames {:.7g} s apart", who,
                     asked_period_s, weights, *period_s);
}

void TrainedFor::CheckCameras(const std::vector<std::string>& asked, const std::string& who) const {
  if (cameras.empty() || cameras == asked) return;
  throw InvalidInput("{}: found cameras {}, wanted {}, in this order: those that {} was trained for", who,
                     fmt::join(asked, ", "), fmt::join(cameras, ", "), weights);
}

void TrainedFor::CheckArms(const std::vector<std::string>& asked, const std::string& who) const {
  if (arms.empty() || arms == asked) return;
  throw InvalidInput("{}: found arms {}, wanted {}: those that {} was trained for", who, fmt::join(asked, ", "),
                     fmt::join(arms, ", "), weights);
}

void TrainedFor::CheckPoseMap(const std::string& asked, const std::string& who) const {
  if (pose_map.empty() || pose_map == asked) return;
  throw InvalidInput("{}: pose maps would be drawn with {}, {} was trained with {}", who, asked, weights, pose_map);
}

std::vector<std::string> NamesOf(const std::vector<Camera>& cameras) {
  std::vector<std::string> names;
  for (const Camera& camera : cameras) names.push_back(camera.name);
  return names;
}

}  // namespace evac
