#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string>

#include "core/error.h"
#include "worldmodel/trained_for.h"

/// Any text is what weights may say of themselves, or an InvalidInput; what is taken of it can be computed with. The
/// first line is the period, and the cameras; the rest the page of statistics.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::size_t end = std::min(text.find('\n'), text.size());
  const std::string first = text.substr(0, end), rest = end < text.size() ? text.substr(end + 1) : "";
  try {
    const evac::TrainedFor trained =
        evac::TrainedFor::Of("fuzz", {{"period_s", first}, {"cameras", first}, {"statistics", rest}});
    if (trained.period_s && !(std::isfinite(*trained.period_s) && *trained.period_s > 0)) std::abort();
    for (const double deviation : trained.StatisticsOr(std::nullopt).deviation) {
      if (!(deviation > 0)) std::abort();
    }
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  return 0;
}
