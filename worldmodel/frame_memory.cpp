#include "worldmodel/frame_memory.h"

#include <algorithm>

#include "core/error.h"

namespace evac {

std::vector<std::size_t> SparseMemory(std::size_t frames, std::size_t memory) {
  if (frames == 0 || memory == 0)
    throw InvalidInput("a memory of {} out of {} frames, wanted at least 1", memory, frames);
  std::vector<std::size_t> picked;
  for (std::size_t j = 0; j + 1 < memory; ++j) picked.push_back(frames * j / (memory - 1));
  picked.push_back(frames - 1);
  return picked;
}

std::size_t ChunkCount(std::size_t rows, const ChunkPlanOptions& options) {
  if (rows <= options.memory)
    throw InvalidInput("{} rows of actions, wanted more than the memory of {}", rows, options.memory);
  return (rows - options.memory + options.chunk - 1) / options.chunk;
}

ChunkPlan PlanChunk(std::size_t rows, std::size_t index, const ChunkPlanOptions& options) {
  if (index >= ChunkCount(rows, options)) throw InvalidInput("chunk {} of {} rows, which end before it", index, rows);
  const std::size_t first = index * options.chunk, deltas = rows - options.memory;
  ChunkPlan plan{SparseMemory(options.memory + first, options.memory), {}, {}};
  if (index == 0) {  // nothing imagined yet: the frames given, in order
    for (std::size_t j = 0; j < options.memory; ++j) plan.memory[j] = j;
  }
  plan.rows = plan.memory;
  for (std::size_t k = 0; k < options.chunk; ++k) plan.rows.push_back(std::min(options.memory + first + k, rows - 1));
  const bool late = options.delta_window && index > 0;
  const std::size_t from = late ? first + options.memory - 1 : first;
  const std::size_t to = late ? first + options.memory + options.chunk : first + options.chunk;
  for (std::size_t d = from; d < std::min(to, deltas); ++d) plan.deltas.push_back(d);
  const bool is_short = options.memory + first + options.chunk > rows;
  if ((!late || is_short) && plan.deltas.size() < options.chunk) plan.deltas.resize(options.chunk);
  return plan;
}

}  // namespace evac
