#include <cstdint>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string>

#include "apps/collect_recipe.h"
#include "apps/network_parts.h"
#include "core/error.h"
#include "policies/hold_policy.h"
#include "reports/csv.h"
#include "tests/fuzz/scratch.h"
#include "tests/fuzz/small_recipe.h"

/// The networks' own program has it (apps/networks); what weights are is another target's. Here any file is.
std::unique_ptr<evac::Policy> evac::MakeLearnedPolicy(const std::filesystem::path&, int chunk_size) {
  return std::make_unique<HoldPolicy>(chunk_size);
}

namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

void Write(const Scratch& scratch, const char* file, const std::string& text) {
  scratch.Write(file, reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
}

std::optional<evac::Recipe> Read(const std::filesystem::path& path) {
  try {
    return evac::ReadRecipe(path, {});
  } catch (const evac::Error& error) {
    Require(error.exit_code() == evac::ExitCode::kInvalidInput);
    return std::nullopt;
  }
}

std::size_t CellsOf(const std::string& table) {
  const std::string name = "manifest.csv";
  return evac::CsvReader(table, name).Next().value().cells.size();
}

/// Of a recipe that was read, each episode can be: its policy takes what is drawn, its row comes back, its line has a
/// cell for every column.
void Check(const evac::Recipe& recipe) {
  Require(recipe.hash.size() == 64 && recipe.episodes > 0 && recipe.episodes <= evac::kMostEpisodes);
  for (std::int64_t index = 0; index < 16; ++index) {
    evac::CollectJob job = evac::JobAt(recipe, 7, index);
    evac::MakePolicy(job, recipe.chunk_size);
    job.row.frames = 1;
    const std::string row = evac::CollectedJson(job.row);
    Require(evac::CollectedJson(evac::ParseCollected(row, "row")) == row);
    Require(CellsOf(evac::CollectedCsvLine(job.row)) == CellsOf(evac::CollectedCsvHeading()));
  }
}

}  // namespace

/// The first byte says what the others are: a recipe of `evac collect`, its task's page or its profile; the other pages
/// are as in small_recipe.h. It is refused, or it can be done and reads the same from what a collection keeps of it.
/// What holds a '/' is not tried: it may name a device that never ends.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::string bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  if (bytes.find('/') != std::string::npos) return 0;
  static const Scratch scratch;
  Write(scratch, "scene.xml", kRecipeScene);
  for (const RecipePage& page : kRecipePages) Write(scratch, page.file, page.letter == data[0] ? bytes : page.text);
  const std::optional<evac::Recipe> recipe = Read(scratch.folder() / "recipe.yaml");
  if (!recipe) return 0;
  Check(*recipe);
  Write(scratch, "kept.yaml", recipe->text);
  Require(evac::ReadRecipe(scratch.folder() / "kept.yaml", {}).hash == recipe->hash);
  return 0;
}
