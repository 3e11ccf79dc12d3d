#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

/// `./run` in a folder where nothing is built and programs say what they were told.
namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class RunFolder : public testing::Test {
 protected:
  /// @param packages  lines of cmake/packages.txt
  explicit RunFolder(const std::string& packages) {
    fs::copy_file(EVAC_SOURCE_DIR "/run", folder_ / "run");
    fs::create_directories(folder_ / "cmake");
    std::ofstream(folder_ / "cmake" / "packages.txt") << packages;
    for (const char* tool : {"bin/cmake", "bin/ip"}) Program(tool, "");
  }

  void Program(const std::string& name, const std::string& text) const {
    const fs::path file = folder_ / name;
    fs::create_directories(file.parent_path());
    std::ofstream(file) << "#!/bin/sh\n" << text;
    fs::permissions(file, fs::perms::owner_all);
  }

  TempFolder folder_;
};

class RunRate : public RunFolder {
 protected:
  RunRate() : RunFolder("") {
    Program("build/release/bin/evac",
            "echo evac \"$@\"\nif [ \"$1 $2\" = 'rate new' ]; then mkdir -p \"$3\" && touch \"$3/study.sqlite\"; fi\n");
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
};

TEST_F(RunRate, TheDemosStudyIsOutStudyHoweverItIsNamed) {
  EXPECT_THAT(Rate(), HasSubstr("evac rate new out/study --run out/demo --gold-from oracle --states 3\n"));
  for (const std::string& name : {std::string("out/demo"), std::string("./out/demo/"), At("out/demo")}) {
    const std::string told = Rate(name);
    EXPECT_THAT(told, Not(HasSubstr("rate new"))) << name;
    EXPECT_THAT(told, HasSubstr("evac rate serve out/study\n")) << name;
  }
}

/// After an update with other weights it said "choose another folder", which `./run demo` cannot.
TEST_F(RunRate, ADemoThatIsAnotherSuitesSaysHowItGoes) {
  Program("build/release/bin/evac", "exit 2\n");
  const std::vector<std::string> words = {"/usr/bin/env", "PATH=" + (folder_ / "bin").string() + ":/usr/bin:/bin",
                                          "/bin/bash", (folder_ / "run").string(), "demo"};
  const CommandResult refused = RunCommand(words);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.out + refused.err, Not(HasSubstr("rm -r"))) << "there is none: an option was wrong";
  Program("out/demo/evac.sqlite", "");
  const CommandResult older = RunCommand(words);
  EXPECT_EQ(older.exit_code, 2);
  EXPECT_THAT(older.out + older.err, HasSubstr("an earlier demo goes with: rm -r out/demo"));
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

/// `./run build` where a package is missing, on a machine that has the programs in `bin` alone.
class RunInstall : public RunFolder {
 protected:
  RunInstall() : RunFolder("# what is needed\nlibneeded-dev\n") {
    for (const std::string tool : {"dirname", "grep", "mkdir", "env"})
      fs::create_symlink("/usr/bin/" + tool, folder_ / "bin" / tool);
    Program("bin/dpkg-query", "exit 1\n");
    Program("bin/apt-get", "echo apt-get \"$@\"\n");
  }

  void HaveSudo() const { Program("bin/sudo", "echo sudo \"$@\"\nexec \"$@\"\n"); }

  /// @param user  its number: 0 is root
  CommandResult Build(int user) const {
    Program("bin/id", "echo " + std::to_string(user) + "\n");
    return RunCommand(
        {"/usr/bin/env", "PATH=" + (folder_ / "bin").string(), "/bin/bash", (folder_ / "run").string(), "build"});
  }
};

constexpr const char* kInstalls = "\napt-get install -y -qq --no-install-recommends libneeded-dev\n";

TEST_F(RunInstall, AsRootItInstallsItselfThoughThereIsSudo) {
  HaveSudo();
  const CommandResult built = Build(0);
  EXPECT_EQ(built.exit_code, 0) << built.err;
  EXPECT_EQ(built.out, "apt-get update -qq\n");
  EXPECT_THAT(built.err, HasSubstr(kInstalls));
  EXPECT_THAT(built.err, Not(HasSubstr("sudo")));
}

TEST_F(RunInstall, AsAnotherUserItInstallsWithSudo) {
  HaveSudo();
  const CommandResult built = Build(1000);
  EXPECT_EQ(built.exit_code, 0) << built.err;
  EXPECT_EQ(built.out, "sudo apt-get update -qq\napt-get update -qq\n");
  EXPECT_THAT(built.err, HasSubstr("\nsudo env DEBIAN_FRONTEND=noninteractive apt-get install -y"));
  EXPECT_THAT(built.err, HasSubstr(kInstalls));
}

TEST_F(RunInstall, WithoutSudoItSaysWhatIsToBeDoneAsRootAndDoesNothing) {
  const CommandResult built = Build(1000);
  EXPECT_EQ(built.exit_code, 1) << built.err;
  EXPECT_THAT(built.err, HasSubstr("there is no sudo here; as root, please: apt-get update -qq"));
  EXPECT_EQ(built.out, "");
  EXPECT_THAT(built.err, Not(HasSubstr("building")));
}

}  // namespace
}  // namespace evac
