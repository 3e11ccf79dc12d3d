#include "apps/interrupts.h"

#include <gtest/gtest.h>
#include <signal.h>

namespace evac {
namespace {

bool KillsAtOnce(int signal) {
  struct sigaction now {};
  ::sigaction(signal, nullptr, &now);
  return now.sa_handler == SIG_DFL;
}

TEST(Interrupts, OneThatCameBeforeAPartOfTheWorkBeganEndsThatPartToo) {
  const CatchInterrupts whole;
  ::raise(SIGINT);
  {
    const CatchInterrupts part;
    EXPECT_TRUE(IsInterrupted());
    EXPECT_TRUE(KillsAtOnce(SIGINT)) << "the second Ctrl-C is to kill at once, whatever began between the two";
  }
  EXPECT_TRUE(IsInterrupted());
}

TEST(Interrupts, TheFirstAfterAPartOfTheWorkEndedEndsTheRestInOrder) {
  const CatchInterrupts whole;
  { const CatchInterrupts part; }
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) ASSERT_FALSE(KillsAtOnce(signal)) << signal;
  ::raise(SIGTERM);
  EXPECT_TRUE(IsInterrupted());
}

TEST(Interrupts, AreForgottenWhenOtherWorkBeginsAndKillWhereNoneIsDone) {
  {
    const CatchInterrupts first;
    ::raise(SIGINT);
  }
  EXPECT_TRUE(KillsAtOnce(SIGINT));
  const CatchInterrupts second;
  EXPECT_FALSE(IsInterrupted());
}

}  // namespace
}  // namespace evac
