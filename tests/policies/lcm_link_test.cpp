#include "policies/lcm_link.h"

#include <gmock/gmock.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/error.h"
#include "tests/policies/wire_support.h"
#include "tests/support/multicast.h"

namespace evac {
namespace {

TEST(LcmAddress, EveryNameHasAnAddressOfItsOwnAndAlwaysTheSame) {
  const LcmAddress a = LcmAddress::For("out/demo 17 hold"), again = LcmAddress::For("out/demo 17 hold"),
                   b = LcmAddress::For("out/demo 18 hold");
  EXPECT_EQ(a.url, again.url);
  EXPECT_EQ(a.token, again.token);
  EXPECT_NE(a.url, b.url);
  EXPECT_NE(a.token, b.token);
  EXPECT_THAT(a.url,
              testing::MatchesRegex("udpm://239.255.76.67:[12][0-9][0-9][0-9][0-9]\\?ttl=0&recv_buf_size=4194304"));
}

TEST(LcmAddress, ATokenThatWouldBreakAChannelsNameIsRefused) {
  for (const std::string token : {"", "a b", "a_b", "a.*", "0123456789012345678901234567890123456789"}) {
    EXPECT_THROW((LcmAddress{.token = token}.Channel("hello")), Error) << token;
  }
  EXPECT_EQ((LcmAddress{.token = "run-7"}.Channel("hello")), "EVAC_run-7_hello");
}

TEST(LcmLink, AMalformedUrlSaysWhatIsWrong) {
  try {
    LcmLink link("nonsense://1");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_THAT(error.what(), testing::HasSubstr("nonsense://1"));
  }
}

/// Every test of the wire asks WhatIsWrongWithLcm whether to be skipped.
TEST(LcmLink, WhereADatagramToTheGroupComesBackNothingIsWrong) {
  if (!MulticastComesBack()) GTEST_SKIP() << "this machine has no multicast: ip route add 224.0.0.0/4 dev lo";
  std::optional<std::string> wrong = WhatIsWrongWithLcm();
  for (int again = 0; again < 10 && wrong; ++again) wrong = WhatIsWrongWithLcm();  // a busy machine may be late
  EXPECT_EQ(wrong, std::nullopt);
}

/// In a network namespace of its own, which has no route at all. @returns the child's exit code.
int InAnEmptyNetwork(int (*check)()) {
  const pid_t child = ::fork();
  if (child == 0) ::_exit(::unshare(CLONE_NEWNET) == 0 || ::unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0 ? check() : 77);
  int status = 0;
  ::waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(LcmLink, AMachineWithoutAMulticastRouteIsToldHowToGetOne) {
  const int result = InAnEmptyNetwork([] {
    const auto wrong = WhatIsWrongWithLcm();
    return wrong && wrong->find("ip route add 224.0.0.0/4 dev lo") != std::string::npos ? 0 : 1;
  });
  if (result == 77) GTEST_SKIP() << "network namespaces are not allowed here";
  EXPECT_EQ(result, 0);
}

}  // namespace
}  // namespace evac
