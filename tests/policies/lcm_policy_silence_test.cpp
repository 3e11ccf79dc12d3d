#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <thread>
#include <utility>
#include <vector>

#include "policies/lcm_policy.h"
#include "tests/policies/wire_support.h"

namespace evac {
namespace {

using testing::HasSubstr;
using wire::Told;
using Clock = std::chrono::steady_clock;

/// Policies of which nothing is heard for a while, or for ever.
class LcmPolicySilence : public wire::WireTest {
 protected:
  /// A new episode in each.
  static void Begin(LcmPolicy& policy, const std::vector<SceneId>& scenes) {
    for (const SceneId scene : scenes) policy.Reset(scene, wire::TwoCameraTask(), 1);
  }

  /// Where some answer, on a busy machine too, and others never. @param asked  of each restart, what it was told
  static LcmPolicyOptions Firm(const LcmAddress& address, std::vector<Clock::time_point>& asked) {
    LcmPolicyOptions options{.address = address, .deadline_s = 2, .repeat_after_s = 0.05};
    options.restart = [&asked](auto since) { asked.push_back(since); };
    return options;
  }
};

/// Only in the next round, in which it answered nobody, was it taken to hang: that failed all who asked then too.
TEST_F(LcmPolicySilence, OneThatHangsAfterItAnsweredSomeOfARoundIsRestartedInThatRoundAndOnce) {
  const LcmAddress address = wire::OwnAddress();
  std::atomic<bool> hangs = false;
  wire::RawServer server(address, [&](LcmLink& link, const observation_t& header) {
    if (header.episode == 0 && !hangs) link.Publish(address.Channel("chunk"), wire::RawServer::Honest(header));
  });
  std::vector<Clock::time_point> asked;
  LcmPolicy policy(Firm(address, asked));
  Begin(policy, {0, 1, 2, 3});
  const std::vector<Acted> answers = Ask(policy, {0, 1, 2, 3});
  EXPECT_EQ(Told(answers[0]), "chunk");
  for (const int scene : {1, 2, 3}) EXPECT_THAT(Told(answers[scene]), HasSubstr("policy_timeout"));
  EXPECT_EQ(asked.size(), 1u);
  hangs = true;
  EXPECT_THAT(Told(Ask(policy, {0})[0]), HasSubstr("policy_timeout"));
  EXPECT_EQ(asked.size(), 2u) << "silent for a whole deadline again";
}

TEST_F(LcmPolicySilence, OneThatAnswersOthersIsNotTakenToHangBeforeAWholeDeadlineAfterTheLastOfThem) {
  const LcmAddress address = wire::OwnAddress();
  std::atomic<int> answered = 0;
  std::atomic<Clock::rep> last = 0;
  wire::RawServer server(address, [&](LcmLink& link, const observation_t& header) {
    if (header.episode == 0) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(700));
    last = Clock::now().time_since_epoch().count();
    ++answered;
    link.Publish(address.Channel("chunk"), wire::RawServer::Honest(header));
  });
  std::vector<Clock::time_point> asked;
  LcmPolicyOptions options = Firm(address, asked);
  options.repeat_after_s = 20;  // each is answered once
  int answered_before = -1;
  options.restart = [&](auto since) {
    asked.push_back(since);
    answered_before = answered;
  };
  LcmPolicy policy(options);
  Begin(policy, {0, 1, 2, 3, 4});
  const std::vector<Acted> answers = Ask(policy, {0, 1, 2, 3, 4});
  EXPECT_THAT(Told(answers[0]), HasSubstr("policy_timeout"));
  for (const int scene : {1, 2, 3, 4}) EXPECT_EQ(Told(answers[scene]), "chunk") << "2.8 s for all, the deadline is 2 s";
  ASSERT_EQ(asked.size(), 1u);
  EXPECT_EQ(answered_before, 4);
  EXPECT_GE(asked[0], Clock::time_point(Clock::duration(last.load()))) << "its last answer was the last that was heard";
}

TEST_F(LcmPolicySilence, OneThatSaysWhatNobodyAskedForDoesNotHang) {
  const LcmAddress address = wire::OwnAddress();
  wire::RawServer server(address, [&](LcmLink& link, const observation_t& header) {
    chunk_t reply = wire::RawServer::Honest(header);
    if (header.episode != 0) --reply.request;
    link.Publish(address.Channel("chunk"), reply);
  });
  std::vector<Clock::time_point> asked;
  LcmPolicy policy(Firm(address, asked));
  Begin(policy, {0, 1});
  const std::vector<Acted> answers = Ask(policy, {0, 1});
  EXPECT_EQ(Told(answers[0]), "chunk");
  EXPECT_THAT(Told(answers[1]), testing::ContainsRegex("policy_timeout.*it sent [0-9]+ answers to earlier requests"));
  EXPECT_TRUE(asked.empty());
}

/// The time for which the harness was stopped was the policy's thinking, and with `latency: measured` the worlds moved
/// on for as long. In a process of its own, which says by its exit code whether that was so.
TEST_F(LcmPolicySilence, WhatTheHarnessWasStoppedForIsNoThinkingOfThePolicys) {
  constexpr int kStopped_s = 8;
  const LcmAddress address = wire::OwnAddress();
  const pid_t harness = ::fork();
  if (harness == 0) {
    try {
      LcmPolicy policy({.address = address, .deadline_s = 60, .repeat_after_s = 0.2});
      Begin(policy, {0});
      const Acted answer = Ask(policy, {0})[0];
      const auto* chunk = std::get_if<ActionChunk>(&answer);
      ::_exit(chunk == nullptr ? 2 : chunk->thinking_s > kStopped_s / 2 ? 1 : 0);
    } catch (...) {
      ::_exit(3);
    }
  }
  bool is_first = true;
  wire::RawServer server(address, [&](LcmLink& link, const observation_t& header) {
    if (!std::exchange(is_first, false)) return;
    std::this_thread::sleep_for(std::chrono::milliseconds(300));  // it has sent all, and waits
    ::kill(harness, SIGSTOP);
    std::this_thread::sleep_for(std::chrono::seconds(kStopped_s));
    link.Publish(address.Channel("chunk"), wire::RawServer::Honest(header));
    ::kill(harness, SIGCONT);
  });
  int status = 0;
  ::waitpid(harness, &status, 0);
  ASSERT_TRUE(WIFEXITED(status)) << status;
  EXPECT_EQ(WEXITSTATUS(status), 0) << "1: it counted; 2: there was no answer; 3: the wire failed";
}

}  // namespace
}  // namespace evac
