#include "worldmodel/action_statistics.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/config.h"

namespace evac {
namespace {

std::array<double, 12> Twelve(const Config& page, const std::string& key) {
  const auto values = page.Get<std::vector<double>>(key);
  const bool finite = std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
  page.Require(values.size() == 12 && finite, key, "12 finite numbers: left and right xyz, roll, pitch, yaw");
  std::array<double, 12> twelve{};
  std::copy(values.begin(), values.end(), twelve.begin());
  return twelve;
}

ActionStatistics StatisticsIn(const Config& page) {
  page.AllowOnly({"robot", "mean", "deviation"});
  ActionStatistics statistics{page.Get<std::string>("robot"), Twelve(page, "mean"), Twelve(page, "deviation")};
  const auto& deviation = statistics.deviation;
  page.Require(std::all_of(deviation.begin(), deviation.end(), [](double value) { return value > 0; }), "deviation",
               "12 positive numbers");
  return statistics;
}

}  // namespace

ActionStatistics AgiBotWorldStatistics() {
  return {"agibotworld",
          {2.949369387467578e-05, -2.4703978620566167e-09, -3.214520512208581e-05, -0.00010488863132125087,
           6.125598648383931e-06, 9.914418478635093e-05, 2.5206249689794423e-05, 2.386436953835608e-07,
           -3.6538445098187414e-05, -0.0001170051017729845, 9.653312579896854e-06, -0.0001260203458056615},
          {0.0008946039574389581, 0.0011014855217635904, 0.0010237522979384508, 0.010402864950142636,
           0.0049353766216338945, 0.010759416673279353, 0.000943621432585622, 0.0013782102901814636,
           0.0011818999106504536, 0.007539298011753274, 0.00432025757794631, 0.00814967736114264}};
}

ActionStatistics ReadActionStatistics(const std::filesystem::path& path) {
  return StatisticsIn(Config::FromFile(path));
}

ActionStatistics ParseActionStatistics(const std::string& text, const std::string& name) {
  return StatisticsIn(Config::FromText(text, name));
}

}  // namespace evac
