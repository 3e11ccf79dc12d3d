#include "reports/gate_data.h"

#include "core/hash.h"

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
  return Sha256Hex(text);
}

}  // namespace evac
