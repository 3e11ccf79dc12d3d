#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "core/file.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"

/// The two policies of docs/write_a_policy.md, run as the page says.
namespace evac {
namespace {

namespace fs = std::filesystem;
using system_test::kFaults;
using system_test::List;
using system_test::RunWords;

/// The page's block of code in that language.
std::string BlockOfPage(const std::string& language, const std::string& containing) {
  const std::string page = ReadFile(EVAC_SOURCE_DIR "/docs/write_a_policy.md"), fence = "```" + language + "\n";
  for (std::size_t at = page.find(fence); at != std::string::npos; at = page.find(fence, at + 1)) {
    const std::size_t begin = at + fence.size();
    const std::string block = page.substr(begin, page.find("\n```", begin) + 1 - begin);
    if (block.find(containing) != std::string::npos) return block;
  }
  ADD_FAILURE() << "docs/write_a_policy.md has no block of " << language << " with " << containing;
  return "";
}

TEST(WrittenPolicies, TheOneInCppRuns) {  // the build made it of the page
  const TempFolder folder;
  const CommandResult result = RunCommand(RunWords(kFaults, folder / "run",
                                                   {"policies.0={name: wander, checkpoint: v1, command: [documented-wander]}",
                                                    "initial_states.count=1", "still={enabled: false}"}));
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(nlohmann::json::parse(List(folder / "run"))[0]["stop"], "max_chunks");
}

TEST(WrittenPolicies, TheOneInPythonRunsItsTasksByThePagesOwnCommands) {
  const TempFolder folder;
  for (const char* part : {"worldmodel", "policies"})
    fs::create_directory_symlink(fs::path(EVAC_SOURCE_DIR) / part, folder / part);
  WriteText(folder / "wander/wander.py", BlockOfPage("python", "# wander.py"));
  WriteText(folder / "wander/wander.yaml", BlockOfPage("yaml", "# wander.yaml"));
  const std::string commands = BlockOfPage("bash", "pip install lcm");
  const std::string path = fmt::format("export PATH='{}':$PATH\ncd '{}'\n", fs::path(Binary("evac")).parent_path().string(),
                                       folder.path().string());
  const auto run = [&](const std::string& lines) { return RunCommand({"/bin/bash", "-ec", path + lines}); };
  const std::size_t download = commands.find("venv/bin/pip"), then = commands.find("lcm-gen");
  ASSERT_TRUE(download < then && then < commands.size()) << commands;
  const CommandResult made = run(commands.substr(0, download));
  ASSERT_EQ(made.exit_code, 0) << made.out << made.err;
  const CommandResult tried = run("cd wander\n" + commands.substr(download, then - download));
  if (tried.exit_code != 0) {
    const CommandResult other = run("cd wander\nvenv/bin/pip download --no-deps --no-cache-dir --dest other wheel");
    ASSERT_NE(other.exit_code, 0) << "other packages can be had: " << tried.out << tried.err;
    GTEST_SKIP() << "no package can be had here: " << tried.out << tried.err;
  }
  const CommandResult result = run("cd wander\n" + commands.substr(then));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const auto episodes = nlohmann::json::parse(List(folder / "wander/out"));
  EXPECT_EQ(episodes.size(), 4u) << "every task that comes with evac, once";
  for (const auto& episode : episodes) {
    EXPECT_TRUE(episode["failure"].is_null()) << episode["failure"];
    EXPECT_EQ(episode["verdicts"]["oracle"], "failure") << "wandering takes nothing";
  }
}

}  // namespace
}  // namespace evac
