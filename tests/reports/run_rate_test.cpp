#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

/// `./run rate` in a folder where nothing is built and `evac` says what it was told.
namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class RunRate : public testing::Test {
 protected:
  RunRate() {
    fs::copy_file(EVAC_SOURCE_DIR "/run", folder_ / "run");
    fs::create_directories(folder_ / "cmake");
    std::ofstream(folder_ / "cmake" / "packages.txt");
    for (const char* tool : {"bin/cmake", "bin/ip"}) Program(tool, "");
    Program("build/release/bin/evac",
            "echo evac \"$@\"\nif [ \"$1 $2\" = 'rate new' ]; then mkdir -p \"$3\" && touch \"$3/study.sqlite\"; fi\n");
  }

  void Program(const std::string& name, const std::string& text) const {
    const fs::path file = folder_ / name;
    fs::create_directories(file.parent_path());
    std::ofstream(file) << "#!/bin/sh\n" << text;
    fs::permissions(file, fs::perms::owner_all);
  }

  /// What `evac` was told.
  std::string Rate(const std::string& run = "") const {
    const std::string path = "PATH=" + (folder_ / "bin").string() + ":/usr/bin:/bin";
    std::vector<std::string> words = {"/usr/bin/env", path, "/bin/bash", (folder_ / "run").string(), "rate"};
    if (!run.empty()) words.push_back(run);
    const CommandResult rated = RunCommand(words);
    EXPECT_EQ(rated.exit_code, 0) << rated.err;
    return rated.out;
  }

  std::string At(const std::string& name) const { return (fs::canonical(folder_.path()) / name).string(); }

  TempFolder folder_;
};

TEST_F(RunRate, TheDemosStudyIsOutStudyHoweverItIsNamed) {
  EXPECT_THAT(Rate(), HasSubstr("evac rate new out/study --run out/demo --gold-from oracle --states 3\n"));
  for (const std::string& name : {std::string("out/demo"), std::string("./out/demo/"), At("out/demo")}) {
    const std::string told = Rate(name);
    EXPECT_THAT(told, Not(HasSubstr("rate new"))) << name;
    EXPECT_THAT(told, HasSubstr("evac rate serve out/study\n")) << name;
  }
}

TEST_F(RunRate, AnotherRunHasAStudyOfItsOwn) {
  Rate();
  const std::string study = At("out/other run-study"), told = Rate("out/other run");
  EXPECT_THAT(told, HasSubstr("evac rate new " + study + " --run out/other run --gold-from"));
  EXPECT_THAT(told, HasSubstr("evac rate invite " + study + " --role lead\n"));
  EXPECT_THAT(told, HasSubstr("evac rate serve " + study + "\n"));
  const std::string again = Rate("out/other run/");
  EXPECT_THAT(again, Not(HasSubstr("rate new")));
  EXPECT_THAT(again, HasSubstr("evac rate serve " + study + "\n"));
}

}  // namespace
}  // namespace evac
