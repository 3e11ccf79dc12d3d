#include "policies/spec.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

namespace evac {
namespace {

using nlohmann::json;

std::string Text(const std::vector<std::string>& names) {
  return names.empty() ? "any" : fmt::format("{}", fmt::join(names, ", "));
}

std::string Text(const CameraNeed& camera) {
  const auto size = [](int px) { return px == 0 ? std::string("any") : std::to_string(px); };
  return fmt::format("{} {}x{}", camera.name, size(camera.width_px), size(camera.height_px));
}

std::string Text(const std::vector<CameraNeed>& cameras, bool none_means_all) {
  if (cameras.empty()) return none_means_all ? "all" : "none";
  std::vector<std::string> texts;
  for (const CameraNeed& camera : cameras) texts.push_back(Text(camera));
  return fmt::format("{}", fmt::join(texts, ", "));
}

/// One row of the table: a field's values on both sides, and why they do not fit (empty if they do).
struct Row {
  std::string field, harness, policy, why;
};

Row SameText(const std::string& field, const std::string& harness, const std::string& policy) {
  return {field, harness, policy, harness == policy ? "" : "the two must agree"};
}

std::string WhyArmsDiffer(const PolicySpec& harness, const PolicySpec& policy) {
  if (policy.arms.empty() || policy.arms == harness.arms) return "";
  return "the policy moves other arms, or in another order";
}

std::string WhyPeriodDiffers(const PolicySpec& harness, const PolicySpec& policy) {
  if (policy.period_s == 0 || std::abs(policy.period_s - harness.period_s) <= 1e-6 * harness.period_s) return "";
  return "the policy's targets are another time apart than the world executes them";
}

std::string WhyChunkDiffers(const PolicySpec& harness, const PolicySpec& policy) {
  if (policy.chunk_size < harness.chunk_size) return "the policy sends fewer targets than the world executes at once";
  if (policy.chunk_size > harness.chunk_size && policy.needs.contains("whole_chunks")) {
    return "the world would execute only the first of them, and this policy needs whole_chunks";
  }
  return "";
}

std::string WhyCamerasDiffer(const PolicySpec& harness, const PolicySpec& policy) {
  const auto fits = [](int offered_px, int needed_px) { return needed_px == 0 || offered_px == needed_px; };
  for (const CameraNeed& need : policy.cameras) {
    const auto found = std::find_if(harness.cameras.begin(), harness.cameras.end(),
                                    [&](const CameraNeed& c) { return c.name == need.name; });
    if (found == harness.cameras.end()) return fmt::format("the task has no camera {}", need.name);
    if (!fits(found->width_px, need.width_px) || !fits(found->height_px, need.height_px)) {
      return fmt::format("the images of camera {} have another size", need.name);
    }
  }
  return "";
}

std::string WhyNeedsUnknown(const PolicySpec& policy) {
  for (const std::string& need : policy.needs) {
    if (std::find(std::begin(kKnownNeeds), std::end(kKnownNeeds), need) == std::end(kKnownNeeds)) {
      return fmt::format("this harness cannot give \"{}\", only {}", need, fmt::join(kKnownNeeds, ", "));
    }
  }
  return "";
}

std::vector<Row> Rows(const PolicySpec& harness, const PolicySpec& policy) {
  const auto gripper = [](const PolicySpec& s) {
    return fmt::format("{} open … {} closed", s.gripper_open, s.gripper_closed);
  };
  const auto needs = [](const PolicySpec& s) { return fmt::format("{}", fmt::join(s.needs, ", ")); };
  const auto period = [](const PolicySpec& s) {
    return s.period_s == 0 ? std::string("any") : fmt::format("{:.6g} s", s.period_s);
  };
  return {
      {"name", harness.name, policy.name, ""},
      {"checkpoint", harness.checkpoint, policy.checkpoint, ""},
      SameText("action_space", harness.action_space, policy.action_space),
      SameText("frame", harness.frame, policy.frame),
      SameText("quaternion_order", harness.quaternion_order, policy.quaternion_order),
      SameText("image_format", harness.image_format, policy.image_format),
      SameText("gripper", gripper(harness), gripper(policy)),
      {"arms", Text(harness.arms), Text(policy.arms), WhyArmsDiffer(harness, policy)},
      {"period", period(harness), period(policy), WhyPeriodDiffers(harness, policy)},
      {"chunk_size", std::to_string(harness.chunk_size), std::to_string(policy.chunk_size),
       WhyChunkDiffers(harness, policy)},
      {"cameras", Text(harness.cameras, false), Text(policy.cameras, policy.needs.contains("images")),
       WhyCamerasDiffer(harness, policy)},
      {"needs", needs(harness), needs(policy), WhyNeedsUnknown(policy)},
  };
}

/// Characters, not bytes: "…" is one.
std::size_t Width(const std::string& text) {
  return std::count_if(text.begin(), text.end(), [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; });
}

std::string Padded(const std::string& text, std::size_t width) {
  return text + std::string(width - std::min(width, Width(text)), ' ');
}

}  // namespace

PolicySpec HarnessSpec(const Task& task, int chunk_size) {
  PolicySpec spec{.name = "evac", .arms = task.arms, .period_s = task.period_s, .chunk_size = chunk_size};
  for (const Camera& camera : task.cameras) spec.cameras.push_back({camera.name, camera.width_px, camera.height_px});
  return spec;
}

std::vector<SpecMismatch> Compare(const PolicySpec& harness, const PolicySpec& policy) {
  std::vector<SpecMismatch> mismatches;
  for (const Row& row : Rows(harness, policy)) {
    if (!row.why.empty()) mismatches.push_back({row.field, row.harness, row.policy, row.why});
  }
  return mismatches;
}

std::string Changes(const PolicySpec& before, const PolicySpec& now) {
  const std::vector<Row> old_rows = Rows(before, before), new_rows = Rows(before, now);
  std::string changes;
  for (std::size_t i = 0; i < new_rows.size(); ++i) {
    const std::string &was = old_rows[i].policy, &is = new_rows[i].policy;
    if (was != is) changes += fmt::format("{}{} was {}, is {}", changes.empty() ? "" : "; ", new_rows[i].field, was, is);
  }
  return changes;
}

std::string WhoDeclares(const std::string& who, const PolicySpec& declared) {
  if (who.empty()) return fmt::format("policy {}@{}", declared.name, declared.checkpoint);
  return fmt::format("{}, which declares itself as {}@{},", who, declared.name, declared.checkpoint);
}

std::string SideBySide(const PolicySpec& harness, const PolicySpec& policy) {
  std::vector<Row> rows = Rows(harness, policy);
  rows.insert(rows.begin(), Row{"", "this run", "the policy", ""});
  std::size_t field_width = 0, harness_width = 0;
  for (const Row& row : rows) {
    field_width = std::max(field_width, Width(row.field));
    harness_width = std::max(harness_width, Width(row.harness));
  }
  std::string table, reasons;
  for (const Row& row : rows) {
    table += fmt::format("{} {}  {}  {}\n", row.why.empty() ? ' ' : '*', Padded(row.field, field_width),
                         Padded(row.harness, harness_width), row.policy);
    if (!row.why.empty()) reasons += fmt::format("{}: {}\n", row.field, row.why);
  }
  return table + reasons;
}

std::string ToJson(const PolicySpec& spec) {
  json cameras = json::array();
  for (const CameraNeed& camera : spec.cameras) {
    cameras.push_back({{"name", camera.name}, {"width_px", camera.width_px}, {"height_px", camera.height_px}});
  }
  return json{{"name", spec.name},
              {"checkpoint", spec.checkpoint},
              {"action_space", spec.action_space},
              {"frame", spec.frame},
              {"quaternion_order", spec.quaternion_order},
              {"image_format", spec.image_format},
              {"gripper_open", spec.gripper_open},
              {"gripper_closed", spec.gripper_closed},
              {"arms", spec.arms},
              {"period_s", spec.period_s},
              {"chunk_size", spec.chunk_size},
              {"cameras", cameras},
              {"needs", spec.needs}}
      .dump(-1, ' ', false, json::error_handler_t::replace);
}

}  // namespace evac
