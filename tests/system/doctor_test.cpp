#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/system/run_support.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;

TEST(Doctor, LooksAtEveryPartThatARunNeeds) {
  const CommandResult result = RunCommand({Binary("evac"), "doctor"});
  for (const char* part :
       {"versions", "threads", "disk", "store", "video", "images", "multicast", "buffers", "rendering"})
    EXPECT_THAT(result.out, ContainsRegex(std::string("(ok  |note|FAIL) ") + part));
  EXPECT_THAT(result.out, AllOf(HasSubstr("SQLite 3."), HasSubstr("libavcodec "), HasSubstr("MuJoCo ")));
  EXPECT_EQ(result.exit_code, result.out.find("FAIL") == std::string::npos ? 0 : 1);
}

TEST(Doctor, WithoutANetworkItSaysWhatToDo) {
  const CommandResult result = RunCommand({"/usr/bin/unshare", "-n", Binary("evac"), "doctor"});
  if (result.out.empty()) GTEST_SKIP() << "a network namespace needs root: " << result.err;
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.out,
              AllOf(ContainsRegex("FAIL multicast .*ip route add 224.0.0.0/4 dev lo"), HasSubstr("ok   store")));
}

TEST(Doctor, WithoutAPlaceForTemporaryFilesItSaysSoAndLooksAtTheRest) {
  const CommandResult result = RunCommand({"/usr/bin/env", "TMPDIR=/nowhere", Binary("evac"), "doctor"});
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_THAT(result.out, AllOf(ContainsRegex("FAIL disk .*set TMPDIR"), HasSubstr("ok   images")));
}

}  // namespace
}  // namespace evac
