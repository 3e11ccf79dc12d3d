#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "apps/networks/training_page.h"
#include "core/error.h"
#include "tests/fuzz/scratch.h"

namespace {

using evac::train::Settings;

void Require(bool holds) {
  if (!holds) std::abort();
}

/// Where options are read from.
struct Said {
  std::string page;                      ///< a file, or none
  std::vector<std::string> assignments;  ///< of --set
};

/// @returns false if it is refused
bool Read(const Said& said, const std::string& section, const Settings& settings) {
  try {
    evac::ReadTrainingPage(said.page, section, said.assignments, settings);
    return true;
  } catch (const evac::Error& error) {
    Require(error.exit_code() == evac::ExitCode::kInvalidInput);
    return false;
  }
}

/// What is read says the same in the lines of a job (training_job.h) and, where it is no text, which YAML quotes, by
/// --set.
template <class Options>
void Check(const Said& said, const std::string& section) {
  Options options, of_lines, of_set;
  const Settings read = SettingsOf(options), lines = SettingsOf(of_lines), set = SettingsOf(of_set);
  if (!Read(said, section, read)) return;
  for (std::size_t i = 0; i < read.size(); ++i) {
    const std::string text = TextOf(read[i]);
    Require(text.find('\n') == std::string::npos);
    Require(SetFromText(lines[i], text) && TextOf(lines[i]) == text);
    if (std::holds_alternative<std::string*>(read[i].field)) continue;
    Require(Read({"", {read[i].name + "=" + text}}, section, set) && TextOf(set[i]) == text);
  }
  if constexpr (std::is_same_v<Options, evac::train::WorldOptions>) {
    try {
      options.Resolve();
    } catch (const evac::TensorError&) {
    }
  }
}

}  // namespace

/// Whatever a page of training options says, and before it, in the first line, a --set: it is refused, or what was read
/// can be written and read again.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::size_t end = std::min(text.find('\n'), size);
  Said said;
  if (end > 0) said.assignments.push_back(text.substr(0, end));
  if (end + 1 < size) {
    scratch.Write("page.yaml", data + end + 1, size - end - 1);
    said.page = (scratch.folder() / "page.yaml").string();
  }
  Check<evac::train::CodecOptions>(said, "codec");
  Check<evac::train::ForecastOptions>(said, "forecast");
  Check<evac::train::WorldOptions>(said, "world");
  return 0;
}
