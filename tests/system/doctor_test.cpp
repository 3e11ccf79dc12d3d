#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/multicast.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

TEST(Doctor, LooksAtEveryPartThatARunNeeds) {
  const CommandResult result = RunCommand({Binary("evac"), "doctor"});
  for (const char* part :
       {"versions", "threads", "disk", "store", "video", "images", "multicast", "buffers", "rendering"})
    EXPECT_THAT(result.out, ContainsRegex(std::string("(ok  |note|FAIL) ") + part));
  EXPECT_THAT(result.out, AllOf(HasSubstr("SQLite 3."), HasSubstr("libavcodec "), HasSubstr("MuJoCo ")));
  EXPECT_EQ(result.exit_code, result.out.find("FAIL") == std::string::npos ? 0 : 1);
}

TEST(Doctor, FindsNothingBrokenWhereTheOtherTestsPass) {
  const CommandResult result = RunCommand({Binary("evac"), "doctor"});
  EXPECT_THAT(result.out, Not(ContainsRegex("FAIL (versions|threads|store|video|images|rendering)")));
  if (!MulticastComesBack()) GTEST_SKIP() << "this machine has no multicast: ip route add 224.0.0.0/4 dev lo";
  EXPECT_THAT(result.out, Not(HasSubstr("FAIL multicast")));
}

TEST(Doctor, WithoutANetworkItSaysWhatToDo) {
  const CommandResult namespaces = RunCommand({"/usr/bin/unshare", "-n", "true"});
  if (namespaces.exit_code != 0) GTEST_SKIP() << "a network namespace needs root: " << namespaces.err;
  const CommandResult result = RunCommand({"/usr/bin/unshare", "-n", Binary("evac"), "doctor"});
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
