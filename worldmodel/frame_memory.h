#pragma once

#include <cstddef>
#include <optional>
#include <vector>

namespace evac {

/// Which of the frames so far the network sees again: the first, others evenly spaced, and the newest (EVAC's sparse
/// memory, as the reference picks it: docs/evac_quirks.md).
/// @param frames  how many there are, at least 1
/// @param memory  N: how many it sees, at least 1
/// @returns `memory` indices, newest last; for fewer frames than that some are repeated
std::vector<std::size_t> SparseMemory(std::size_t frames, std::size_t memory);

/// What one chunk of a long imagination is made of. Rows are those of the action file: row N - 1 is the pose in the
/// last frame that was given, row N the first to be imagined; frame f shows row f.
struct ChunkPlan {
  std::vector<std::size_t> memory;  ///< N frames, of those given and imagined so far
  std::vector<std::size_t> rows;    ///< T rows, for maps and rays: the memory's, then the chunk's; the last is repeated
  std::vector<std::optional<std::size_t>> deltas;  ///< delta d leads from row N - 1 + d to the next; nothing: no entry
};

struct ChunkPlanOptions {
  std::size_t chunk = 16;  ///< K
  std::size_t memory = 4;  ///< N
  /// Quirk delta_window: from the second chunk on the reference takes its deltas N - 1 rows too late and one too many,
  /// as far as there are any, and fills up with entries that say nothing only where it also runs out of rows.
  bool delta_window = false;
};

/// @param rows   in the action file, more than N
/// @param index  of the chunk, from 0
ChunkPlan PlanChunk(std::size_t rows, std::size_t index, const ChunkPlanOptions& options);

/// Chunks until every row has its frame.
std::size_t ChunkCount(std::size_t rows, const ChunkPlanOptions& options);

}  // namespace evac
