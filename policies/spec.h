#pragma once

#include <set>
#include <string>
#include <vector>

#include "core/types.h"

namespace evac {

/// A camera that one side offers or needs.
struct CameraNeed {
  std::string name{};
  int width_px = 0;   ///< 0: any
  int height_px = 0;  ///< 0: any
  bool operator==(const CameraNeed&) const = default;
};

/// The conventions one side of the link keeps to. Harness and policy each declare theirs, and they are compared before
/// the first episode: a silent difference here is what most "cannot reproduce" reports of this field turn out to be.
/// The defaults are this project's own conventions; a policy that differs says so and is refused, never converted
/// silently.
struct PolicySpec {
  std::string name{};
  std::string checkpoint{};
  std::string action_space = "absolute";  ///< "absolute" targets, or "delta" to the pose before
  std::string frame = "base";             ///< what targets and arm states are relative to
  std::string quaternion_order = "xyzw";
  std::string image_format = "RGB";
  double gripper_open = 0;            ///< the number that means open …
  double gripper_closed = 1;          ///< … and closed: range and sense in one
  std::vector<std::string> arms{};    ///< in order: {right}, or {left, right}; empty in a policy: any
  double period_s = 0;                ///< between two targets; 0 in a policy: any
  int chunk_size = 1;                 ///< harness: targets it executes per chunk; policy: targets it sends per chunk
  std::vector<CameraNeed> cameras{};  ///< empty in a policy that needs images: all the task has
  std::set<std::string> needs{};      ///< of kKnownNeeds; a policy's only
  bool operator==(const PolicySpec&) const = default;
};

/// images: they are sent (only those of `cameras`); arms, instruction: it reads them (they are sent anyway);
/// whole_chunks: it must know what was executed, so the harness has to execute every target it sends.
inline constexpr const char* kKnownNeeds[] = {"instruction", "arms", "images", "whole_chunks"};

/// What the harness declares for tasks of one kind.
PolicySpec HarnessSpec(const Task& task, int chunk_size);

/// One row in which the two do not fit together.
struct SpecMismatch {
  std::string field;    ///< as in PolicySpec
  std::string harness;  ///< its value
  std::string policy;
  std::string why;  ///< "the policy sends fewer targets than the world executes at once"
};

/// Nothing if they fit: a longer chunk fits (its first targets are executed), a shorter one or another period does not.
std::vector<SpecMismatch> Compare(const PolicySpec& harness, const PolicySpec& policy);

/// "chunk_size was 16, is 8": what one policy declares otherwise than it did; nothing if it is the same.
std::string Changes(const PolicySpec& before, const PolicySpec& now);

/// Both declarations as a table, a row per field, a `*` before each row that does not fit and the reasons below.
std::string SideBySide(const PolicySpec& harness, const PolicySpec& policy);

/// "policy good@v1, which declares itself as probe@c1,": begins what is wrong with a declaration. @param who  "policy
/// good@v1", as the suite calls it; empty: nobody but the policy itself says a name
std::string WhoDeclares(const std::string& who, const PolicySpec& declared);

/// As the store keeps it: every field under its name. Bytes that are no UTF-8 are shown as U+FFFD.
std::string ToJson(const PolicySpec& spec);

}  // namespace evac
