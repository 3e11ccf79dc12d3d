#pragma once

#include <cstdint>
#include <filesystem>

#include "judges/classifier_net.h"

namespace evac {

/// Writes a judge of fewer looks as one of `shape.looks`: its answers are the same at first, since nothing counts yet of
/// what the new looks see. Where they look at first is drawn from the seed. The card is copied.
/// @param from  a judge of the same tasks and views
/// @throws TensorError if it is none, or looks at more places than the new one
void WidenJudge(const std::filesystem::path& from, const ClassifierShape& shape, std::uint64_t seed, const std::filesystem::path& to);

}  // namespace evac
