#include "reports/gate_data.h"

#include "core/hash.h"
#include "core/run_extent.h"

namespace evac {

std::string DataHash(const RunData& data) {
  std::string text = data.run.suite_hash + "\n";
  for (const Episode& episode : data.episodes) {
    const std::string id = episode.key.Id();
    text += id + (IsFailure(episode.stop) ? "\terror" : "\tended");
    if (const auto verdicts = data.verdicts.find(id); verdicts != data.verdicts.end()) {
      for (const auto& [judge, verdict] : verdicts->second) text += "\t" + judge + "=" + Name(verdict.label);
    }
    text += "\n";
  }
  // What was decided of a part without knowing it (by an earlier evac, say) does not stand for what is known to be one.
  if (const RunExtent extent = ExtentOf(data.plan, data.episodes); extent.missing > 0)
    text += "of " + std::to_string(extent.planned) + "\n";
  return Sha256Hex(text);
}

}  // namespace evac
