#include "apps/interrupts.h"

#include <gtest/gtest.h>
#include <signal.h>

namespace evac {
namespace {

bool Does(int signal, sighandler_t what) {
  struct sigaction now {};
  ::sigaction(signal, nullptr, &now);
  return now.sa_handler == what;
}

bool KillsAtOnce(int signal) { return Does(signal, SIG_DFL); }

/// As on a terminal, whatever the caller of the tests ignores.
class Interrupts : public testing::Test {
 protected:
  Interrupts() {
    for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ::signal(signal, SIG_DFL);
  }
};

TEST_F(Interrupts, OneThatCameBeforeAPartOfTheWorkBeganEndsThatPartToo) {
  const CatchInterrupts whole;
  ::raise(SIGINT);
  {
    const CatchInterrupts part;
    EXPECT_TRUE(IsInterrupted());
    EXPECT_TRUE(KillsAtOnce(SIGINT)) << "the second Ctrl-C is to kill at once, whatever began between the two";
  }
  EXPECT_TRUE(IsInterrupted());
}

TEST_F(Interrupts, TheFirstAfterAPartOfTheWorkEndedEndsTheRestInOrder) {
  const CatchInterrupts whole;
  { const CatchInterrupts part; }
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ASSERT_FALSE(KillsAtOnce(signal)) << signal;
  ::raise(SIGTERM);
  EXPECT_TRUE(IsInterrupted());
}

TEST_F(Interrupts, AreForgottenWhenOtherWorkBeginsAndKillWhereNoneIsDone) {
  {
    const CatchInterrupts first;
    ::raise(SIGINT);
  }
  EXPECT_TRUE(KillsAtOnce(SIGINT));
  const CatchInterrupts second;
  EXPECT_FALSE(IsInterrupted());
}

/// It was killed in mid-episode, by `head`.
TEST_F(Interrupts, AReaderWhoGoesAwayEndsNoWork) {
  ::signal(SIGPIPE, SIG_DFL);
  {
    const CatchInterrupts whole;
    { const CatchInterrupts part; }
    EXPECT_TRUE(Does(SIGPIPE, SIG_IGN));
  }
  EXPECT_TRUE(KillsAtOnce(SIGPIPE));
}

/// `nohup evac train …` ended with the terminal all the same.
TEST_F(Interrupts, ThatTheCallerIgnoresStayIgnoredDuringTheWorkAndAfterIt) {
  ::signal(SIGHUP, SIG_IGN);
  {
    const CatchInterrupts whole;
    ::raise(SIGHUP);
    EXPECT_FALSE(IsInterrupted());
    ::raise(SIGTERM);
    EXPECT_TRUE(IsInterrupted()) << "the others are caught";
  }
  EXPECT_TRUE(Does(SIGHUP, SIG_IGN));
  EXPECT_TRUE(KillsAtOnce(SIGTERM));
  ::signal(SIGHUP, SIG_DFL);
}

TEST_F(Interrupts, DoAfterTheWorkWhatTheyDidBeforeIt) {
  const sighandler_t own = [](int) {};
  ::signal(SIGTERM, own);
  {
    const CatchInterrupts whole;
    EXPECT_FALSE(Does(SIGTERM, own));
  }
  EXPECT_TRUE(Does(SIGTERM, own));
  ::signal(SIGTERM, SIG_DFL);
}

}  // namespace
}  // namespace evac
