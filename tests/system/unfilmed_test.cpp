#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/support/command.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using system_test::List;
using system_test::RunWords;

constexpr const char* kOfFilms[] = {"video", "video_sha256", "thumbnail"};

/// What a run's episodes say of themselves but for their pictures.
json WithoutFilms(json episodes) {
  for (json& episode : episodes) {
    for (const char* field : kOfFilms) episode.erase(field);
  }
  return episodes;
}

TEST(UnfilmedWorld, EpisodesComeOutAsIfTheyHadBeenFilmed) {
  const TempFolder folder;
  const fs::path filmed = folder / "filmed", unfilmed = folder / "unfilmed";
  for (const auto& [run, set] : {std::pair(filmed, "worlds.1.film=true"), std::pair(unfilmed, "worlds.1.film=false")}) {
    const CommandResult done = RunCommand(RunWords(system_test::kSmall, run, {set}));
    ASSERT_EQ(done.exit_code, 0) << done.err;
  }
  const json episodes = json::parse(List(unfilmed));
  EXPECT_EQ(WithoutFilms(episodes), WithoutFilms(json::parse(List(filmed))));
  int without = 0;
  for (const json& episode : episodes) {
    EXPECT_EQ(episode["video"].is_null(), episode["world"] == "sim") << episode.dump();
    without += episode["video"].is_null();
  }
  EXPECT_EQ(without, 8);
  EXPECT_FALSE(fs::exists(unfilmed / "videos" / "sim"));
  const CommandResult report = RunCommand({Binary("evac"), "report", unfilmed.string()});
  EXPECT_EQ(report.exit_code, 0) << report.err;
}

}  // namespace
}  // namespace evac
