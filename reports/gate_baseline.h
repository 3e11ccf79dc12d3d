#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "reports/summary.h"

/// A pinned result: what every policy came to in every initial state, in one file with its own hash. It is what gates
/// compare with, never "the previous run" (docs/formats/pinned_json.md).
namespace evac {

/// One episode, as a gate sees it.
struct PinnedOutcome {
  std::string initial_state;
  std::uint64_t seed = 0;
  Outcome outcome = Outcome::kUnjudged;
  std::string video;  ///< from the run's folder; may be empty
  bool Counts() const { return outcome == Outcome::kSuccess || outcome == Outcome::kFailure; }
};

/// One policy on one task in one world.
struct PinnedCell {
  std::string task, world, policy;      ///< policy with its checkpoint
  std::vector<PinnedOutcome> outcomes;  ///< in the order of (initial state, seed), each once
  /// SHA-256 of the list of (initial state, seed): which list it was run on, whatever came of it.
  std::string InitialStatesHash() const;
};

struct PinnedResult {
  std::string run;                            ///< the folder it was pinned from, as it was named then
  std::string suite_hash, store_hash, judge;  ///< store_hash: DataHash
  std::map<std::string, std::string> tasks;   ///< id → SHA-256 of what the task's page says
  std::map<std::string, std::string> worlds;  ///< name → profile hash
  // What else decides outcomes; empty in a file of an earlier evac, which is compared without.
  std::map<std::string, std::string> scenes;       ///< id → SHA-256 of the task's page with all files that it names
  std::map<std::string, std::string> definitions;  ///< id → SHA-256 of its cameras, stop rule and limits
  std::map<std::string, std::string> settings;     ///< of the suite: "chunk_size" → "8", "policy.latency" → "off"
  std::vector<PinnedCell> cells;              ///< in the order of (task, world, policy)
  std::string sha256;                         ///< of everything above

  /// Names without repeats, in order.
  std::vector<std::string> Policies() const;
};

/// @param run  the folder's name, for the paths of clips.
PinnedResult Pin(const RunSummary& summary, const std::string& run);

/// As a file: indented JSON, its hash last.
std::string PinnedJson(const PinnedResult& pinned);
/// @param file  what messages call the text.
/// @throws InvalidInput if it is no pinned result, a field is wrong, or its hash is not that of its content: changed by
/// hand.
PinnedResult ReadPinned(const std::string& text, const std::string& file);

}  // namespace evac
