#include <cstdint>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <string>

#include "tests/fuzz/scratch.h"
#include "worldmodel/train/csv_log.h"
#include "worldmodel/train/curves.h"

namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

std::string TextOf(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

}  // namespace

/// Whatever is in a training's tables: they are a picture, and what goes on from step 100 keeps earlier rows alone, the
/// same however often it begins.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  const std::filesystem::path metrics = scratch.folder() / "metrics.csv";
  for (const char* table : {"metrics.csv", "holdout.csv"}) scratch.Write(table, data, size);
  const std::string svg = evac::train::CurvesSvg(scratch.folder());
  Require(svg.starts_with("<svg ") && svg.ends_with("</svg>\n"));
  evac::train::CsvLog::Trim(metrics, "step,loss", 100);
  const std::string kept = TextOf(metrics);
  Require(kept.starts_with("step,loss\n") && kept.ends_with("\n"));
  evac::train::CsvLog::Trim(metrics, "step,loss", 100);
  Require(TextOf(metrics) == kept);
  return 0;
}
