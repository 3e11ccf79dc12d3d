#pragma once

#include <filesystem>
#include <string>

namespace evac::train {

/// How a training goes, as one SVG: above the loss (a mean over neighbouring steps, and all of it as a pale band), below
/// the hold-out with its best marked; steps to the right. Read from what the Trainer writes; a file that is not there, or
/// rows that cannot be read, are left out. The same bytes for the same tables. Scales are logarithmic where all numbers
/// are above 0.
/// @param folder  with metrics.csv and holdout.csv
std::string CurvesSvg(const std::filesystem::path& folder);

/// Writes folder/curves.svg, whole or not at all. @throws TensorError with the system's reason.
void WriteCurves(const std::filesystem::path& folder);

}  // namespace evac::train
