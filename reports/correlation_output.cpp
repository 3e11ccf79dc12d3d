#include "reports/correlation_output.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <string_view>

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

void Put(Json& json, const std::string& key, const Number& number) {
  json[key] = number ? Json(*number) : Json(nullptr);
  if (!number) json[key + "_reason"] = number.reason();
}

void Put(Json& json, const std::string& key, const Defined<Interval>& interval) {
  json[key] = interval ? Json::array({interval->low, interval->high}) : Json(nullptr);
  if (!interval) json[key + "_reason"] = interval.reason();
}

void Put(Json& json, const std::string& key, const Estimate& estimate) {
  Put(json, key, estimate.value);
  Put(json, key + "_ci95", estimate.interval);
  json[key + "_ci95_method"] = estimate.method;
}

Json JsonOf(const CorrelationPoint& point) {
  Json json = {{"task", point.task}, {"policy", point.policy}, {"real_sr", point.real_sr}, {"sim_sr", point.sim_sr}};
  if (point.real) json["real_n"] = point.real->trials;
  if (point.sim) json["sim_n"] = point.sim->trials;
  return json;
}

bool IsBootstrapped(const CorrelationGroup& group) {
  return std::ranges::any_of(group.points, [](const CorrelationPoint& point) { return point.real.has_value(); });
}

void PutBootstrap(Json& json, const CorrelationGroup& group) {
  Put(json, "pearson_ci95_bca", group.pearson_bca);
  Put(json, "spearman_ci95_bca", group.spearman_bca);
  Put(json, "mmrv_ci95_bca", group.mmrv_bca);
  json["bootstrap_replicates"] = group.options.bootstrap.replicates;
  json["bootstrap_seed"] = group.options.bootstrap.seed;
  json["undefined_replicates"] = group.undefined_replicates;
}

Json JsonOf(const CorrelationGroup& group) {
  Json json = {{"group", group.group}, {"n", group.points.size()}};
  Put(json, "pearson", group.pearson);
  Put(json, "spearman", group.spearman);
  Put(json, "mmrv", group.mmrv);
  json["mmrv_convention"] =
      fmt::format("{},{}", Name(group.options.convention.gap), Name(group.options.convention.ties));
  json["ties"] = group.ranks.ties;
  json["ties_real"] = group.ranks.ties_real;
  json["ties_sim"] = group.ranks.ties_sim;
  Put(json, "mmrv_over_range", group.ranks.over_range);
  Put(json, "kendall_tau_b", group.kendall_tau_b);
  Put(json, "bias", group.distance.bias);
  Put(json, "mae", group.distance.mae);
  Put(json, "rmse", group.distance.rmse);
  Put(json, "ccc", group.distance.ccc);
  if (IsBootstrapped(group)) PutBootstrap(json, group);
  json["points"] = Json::array();
  for (const CorrelationPoint& point : group.points) json["points"].push_back(JsonOf(point));
  json["left_out"] = group.left_out;
  return json;
}

/// A table whose columns are as wide as their widest cell.
class TextTable {
 public:
  void Add(std::vector<std::string> cells) { rows_.push_back(std::move(cells)); }

  std::string Text() const {
    std::string text;
    for (const std::vector<std::string>& row : rows_) {
      std::string line;
      for (std::size_t column = 0; column < row.size(); ++column)
        line += fmt::format("{:<{}}  ", row[column], Width(column));
      text += fmt::format("{}\n", std::string_view(line).substr(0, line.find_last_not_of(' ') + 1));
    }
    return text;
  }

 private:
  std::size_t Width(std::size_t column) const {
    std::size_t width = 0;
    for (const std::vector<std::string>& row : rows_) width = std::max(width, row[column].size());
    return width;
  }

  std::vector<std::vector<std::string>> rows_;
};

std::string TextOf(const Number& number) { return number ? fmt::format("{:.3f}", *number) : "undefined"; }

std::string TextOf(const Estimate& estimate) {
  if (!estimate.value || !estimate.interval) return TextOf(estimate.value);
  return fmt::format("{:.3f} [{:.3f}, {:.3f}]", *estimate.value, estimate.interval->low, estimate.interval->high);
}

std::string TextOf(double rate, const std::optional<Count>& count) {
  return count ? fmt::format("{:.3f} ({}/{})", rate, count->successes, count->trials) : fmt::format("{:.3f}", rate);
}

std::string GroupTable(const std::vector<CorrelationGroup>& groups) {
  TextTable table;
  table.Add({"group", "n", "Pearson", "Spearman", "MMRV", "MMRV/range", "bias"});
  for (const CorrelationGroup& group : groups) {
    table.Add({group.group, fmt::format("{}", group.points.size()), TextOf(group.pearson), TextOf(group.spearman),
               TextOf(group.mmrv), TextOf(group.ranks.over_range), TextOf(group.distance.bias)});
  }
  return table.Text();
}

/// Of a run, a group of one task: its points are those of its world's group.
bool RepeatsItsWorld(const CorrelationGroup& group) {
  return IsBootstrapped(group) && group.group.find('/') != std::string::npos;
}

/// The points of every group that has counts, each once.
std::string PointTable(const std::vector<CorrelationGroup>& groups) {
  std::string text;
  for (const CorrelationGroup& group : groups) {
    if (!IsBootstrapped(group) || RepeatsItsWorld(group)) continue;
    TextTable points;
    points.Add({"task", "policy", "real", group.group});
    for (const CorrelationPoint& point : group.points) {
      points.Add({point.task, point.policy, TextOf(point.real_sr, point.real), TextOf(point.sim_sr, point.sim)});
    }
    text += fmt::format("\n{}", points.Text());
  }
  return text;
}

/// What is said below the tables: a sentence and the groups it holds for, each sentence once.
using Notes = std::map<std::string, std::vector<std::string>>;

void NoteEstimate(const std::string& group, const char* name, const Estimate& estimate, Notes& notes) {
  if (!estimate.value) {
    notes[fmt::format("{} is undefined: {}", name, estimate.value.reason())].push_back(group);
  } else if (!estimate.interval) {
    notes[fmt::format("{} has no interval: {}", name, estimate.interval.reason())].push_back(group);
  } else {
    notes[fmt::format("95 % interval of {}: {}", name, estimate.method)].push_back(group);
  }
}

void NoteBootstrap(const CorrelationGroup& group, Notes& notes) {
  for (const std::string& point : group.left_out) notes[fmt::format("left out: {}", point)].push_back(group.group);
  if (group.undefined_replicates == 0) return;
  notes[fmt::format("Pearson is undefined in {} of {} replicates, which are dropped", group.undefined_replicates,
                    group.options.bootstrap.replicates)]
      .push_back(group.group);
}

std::string Footnotes(const std::vector<CorrelationGroup>& groups) {
  Notes notes;
  std::int64_t ties = 0;
  for (const CorrelationGroup& group : groups) {
    if (!RepeatsItsWorld(group)) ties += group.ranks.ties;
    NoteEstimate(group.group, "Pearson", group.pearson, notes);
    NoteEstimate(group.group, "Spearman", group.spearman, notes);
    NoteEstimate(group.group, "MMRV", group.mmrv, notes);
    NoteBootstrap(group, notes);
  }
  std::string text = "\n";
  if (!groups.empty()) {
    text += fmt::format("MMRV (0 is best): {}; {} pair{} of points tied\n", Name(groups[0].options.convention), ties,
                        ties == 1 ? "" : "s");
  }
  for (const auto& [note, holds_for] : notes) {
    const bool for_all = holds_for.size() == groups.size();
    text += for_all ? fmt::format("{}\n", note) : fmt::format("{} ({})\n", note, fmt::join(holds_for, ", "));
  }
  return text;
}

}  // namespace

std::string CorrelationJson(const std::vector<CorrelationGroup>& groups) {
  Json json = {{"groups", Json::array()}};
  for (const CorrelationGroup& group : groups) json["groups"].push_back(JsonOf(group));
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::string CorrelationText(const std::vector<CorrelationGroup>& groups) {
  return GroupTable(groups) + PointTable(groups) + Footnotes(groups);
}

}  // namespace evac
