#include "policies/lcm_policy.h"

#include <gmock/gmock.h>

#include <chrono>
#include <thread>

#include "core/error.h"
#include "tests/policies/wire_support.h"

namespace evac {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using wire::Count;
using wire::Told;

class LcmPolicyTest : public wire::WireTest {
 protected:
  static LcmPolicyOptions Patient(const LcmAddress& address) {
    return {.address = address, .deadline_s = 60, .repeat_after_s = 20};
  }
  /// Where nobody is to answer.
  static LcmPolicyOptions Hasty(const LcmAddress& address) {
    return {.address = address, .deadline_s = 0.2, .repeat_after_s = 0.05};
  }
  /// Where some answer, on a busy machine too, and others never.
  static LcmPolicyOptions Firm(const LcmAddress& address) {
    return {.address = address, .deadline_s = 2, .repeat_after_s = 0.05};
  }
};

TEST_F(LcmPolicyTest, WhatThePolicySeesIsWhatTheHarnessShows) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  LcmPolicyOptions options = Patient(address);
  options.raw_images = true;
  LcmPolicy policy(options);
  const Task task = wire::TwoCameraTask();
  EXPECT_EQ(policy.Handshake(HarnessSpec(task, 2), 30), wire::ProbeSpec());
  EXPECT_EQ(policy.Name(), "probe");

  policy.Reset(3, task, 0xFFFFFFFFFFFFFFFF);
  Observation shown = wire::ObservationFor(task, 5);
  shown.arms_are_commanded = true;
  const SceneObservation asked{3, &shown};
  const std::vector<Acted> answers = policy.Act({&asked, 1});
  ASSERT_EQ(Told(answers.at(0)), "chunk");
  const auto& chunk = std::get<ActionChunk>(answers[0]);
  ASSERT_EQ(chunk.targets.size(), 2u);
  EXPECT_DOUBLE_EQ(chunk.targets[1][0].base_from_gripper.translation().z(),
                   shown.arms[0].base_from_gripper.translation().z() + 0.01);

  const wire::ProbePolicy::Seen seen = probe.seen().begin()->second;
  EXPECT_EQ(seen.seed, 0xFFFFFFFFFFFFFFFF);
  EXPECT_EQ(seen.task.id, task.id);
  EXPECT_EQ(seen.task.instruction, task.instruction);
  EXPECT_EQ(seen.task.cameras.at(1).mount, Mount::kRightGripper);
  EXPECT_EQ(seen.task.cameras[1].fx_px, 60.5);
  const Observation& observed = seen.observations.at(0);
  EXPECT_TRUE(observed.arms_are_commanded);
  EXPECT_EQ(observed.arms.at(0).closure, 0.25);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(cv::norm(observed.images.at(i), shown.images[i], cv::NORM_INF), 0);
}

TEST_F(LcmPolicyTest, OnlyTheCamerasThatWereDeclaredAreSent) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  PolicySpec spec = wire::ProbeSpec();
  spec.cameras = {{"hand_right"}};
  wire::Served served(probe, spec, address);
  LcmPolicyOptions options = Patient(address);
  options.raw_images = true;
  LcmPolicy policy(options);
  const Task task = wire::TwoCameraTask();
  policy.Handshake(HarnessSpec(task, 2), 30);
  policy.Reset(0, task, 1);
  const Observation shown = wire::ObservationFor(task, 5);
  const SceneObservation asked{0, &shown};
  ASSERT_EQ(Told(policy.Act({&asked, 1})[0]), "chunk");
  const auto seen = probe.seen().begin()->second;
  ASSERT_EQ(seen.observations.at(0).images.size(), 1u);
  EXPECT_EQ(seen.task.cameras.at(0).name, "hand_right");
  EXPECT_EQ(cv::norm(seen.observations[0].images[0], shown.images[1], cv::NORM_INF), 0);
}

TEST_F(LcmPolicyTest, DeclarationsThatDoNotFitEndTheRunWithBothSideBySide) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  PolicySpec spec = wire::ProbeSpec();
  spec.action_space = "delta";
  spec.cameras = {{"head", 224, 224}};
  wire::Served served(probe, spec, address);
  LcmPolicy policy(Patient(address));
  try {
    policy.Handshake(HarnessSpec(wire::TwoCameraTask(), 8), 30);
    FAIL() << "was accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_THAT(error.what(), HasSubstr("policy probe@c1 does not fit this run"));
    EXPECT_THAT(error.what(), testing::ContainsRegex("\\* action_space +absolute +delta"));
    EXPECT_THAT(error.what(), testing::ContainsRegex("\\* chunk_size +8 +2"));
    EXPECT_THAT(error.what(), testing::ContainsRegex("\\* cameras +head 48x32, hand_right 48x32 +head 224x224"));
  }
}

/// It was called by its own name alone, under which no suite knows it.
TEST_F(LcmPolicyTest, OneThatDoesNotFitIsCalledAsTheSuiteCallsIt) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  LcmPolicyOptions options = Patient(address);
  options.who = "policy mine@step-4000";
  LcmPolicy policy(options);
  EXPECT_THAT([&] { policy.Handshake(HarnessSpec(wire::TwoCameraTask(), 8), 30); },
              testing::ThrowsMessage<Error>(testing::StartsWith(
                  "policy mine@step-4000, which declares itself as probe@c1, does not fit this run:\n")));
}

TEST_F(LcmPolicyTest, SilenceAtTheHandshakeSaysWhereItListened) {
  const LcmAddress address = wire::OwnAddress();
  LcmPolicy policy(Patient(address));
  try {
    policy.Handshake(HarnessSpec(wire::TwoCameraTask(), 2), 0.05);
    FAIL() << "nobody was there";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr(address.url));
    EXPECT_THAT(error.what(), HasSubstr(address.token));
  }
}

TEST_F(LcmPolicyTest, TwoPoliciesOnOneAddressAreRefused) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy one, other;
  wire::Served first(one, wire::ProbeSpec(), address), second(other, wire::ProbeSpec(), address);
  LcmPolicy policy(Patient(address));
  EXPECT_THAT([&] { policy.Handshake(HarnessSpec(wire::TwoCameraTask(), 2), 30); },
              testing::ThrowsMessage<Error>(HasSubstr("2 policies answer on " + address.url)));
}

TEST_F(LcmPolicyTest, AChunkLongerThanTheWorldsIsCutToIt) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe(5);
  wire::Served served(probe, wire::ProbeSpec(5), address);
  LcmPolicy policy(Patient(address));
  const Task task = wire::TwoCameraTask();
  policy.Handshake(HarnessSpec(task, 3), 30);
  policy.Reset(0, task, 1);
  EXPECT_EQ(std::get<ActionChunk>(Ask(policy, {0}, task)[0]).targets.size(), 3u);
}

TEST_F(LcmPolicyTest, AnErrorOfThePolicyFailsItsSceneAlone) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  LcmPolicy policy(Patient(address));
  const std::vector<std::string> instructions = {"throw", "go", "nan", "refuse", "give up"};
  for (int scene = 0; scene < 5; ++scene) {
    Task task = wire::TwoCameraTask();
    task.instruction = instructions[scene];
    policy.Reset(scene, task, 1);
  }
  const auto answers = Ask(policy, {0, 1, 2, 3, 4}, wire::TwoCameraTask());
  EXPECT_EQ(Told(answers[0]), "policy_error: the policy answered with an error: out of memory on the policy's side");
  EXPECT_EQ(Told(answers[1]), "chunk");
  EXPECT_EQ(Told(answers[2]),
            "policy_error: malformed answer to request 0: target 0 of 2, right arm: position_m[1] is nan, wanted a "
            "finite number");
  EXPECT_EQ(Told(answers[3]), "policy_error: the policy refuses the task: I do not know how");
  EXPECT_EQ(Told(answers[4]), "policy_error: the policy answered with an error: I see nothing");
}

TEST_F(LcmPolicyTest, AMalformedAnswerIsToldWithWhatAndWhere) {
  const LcmAddress address = wire::OwnAddress();
  wire::RawServer server(address, [&](LcmLink& link, const observation_t& header) {
    chunk_t reply = wire::RawServer::Honest(header);
    if (header.episode == 0) reply.targets[0][0].orientation_xyzw[3] = 0.5;
    if (header.episode == 1) reply.targets[0].push_back(reply.targets[0][0]), reply.num_arms = 2;
    if (header.episode == 2) reply.targets.clear(), reply.num_targets = 0;
    link.Publish(address.Channel("chunk"), reply);
  });
  LcmPolicy policy(Patient(address));
  for (int scene = 0; scene < 4; ++scene) policy.Reset(scene, wire::TwoCameraTask(), 1);
  const auto answers = Ask(policy, {0, 1, 2, 3}, wire::TwoCameraTask());
  EXPECT_THAT(Told(answers[0]),
              HasSubstr("target 0 of 1, right arm: orientation_xyzw has norm 0.5, wanted 1 within 0.001"));
  EXPECT_THAT(Told(answers[1]), HasSubstr("the chunk's targets have 2 arms, wanted 1 (right)"));
  EXPECT_THAT(Told(answers[2]), HasSubstr("the chunk has 0 targets, wanted at least 1"));
  EXPECT_EQ(Told(answers[3]), "chunk");
  EXPECT_EQ(Count(policy.counters(), "malformed_replies"), 3);
}

TEST_F(LcmPolicyTest, AShortChunkIsOnlyTakenAtARecordingsEnd) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe(1);  // declares 2, sends 1
  wire::Served served(probe, wire::ProbeSpec(2), address);
  LcmPolicy policy(Patient(address));
  const Task task = wire::TwoCameraTask();
  policy.Handshake(HarnessSpec(task, 2), 30);
  policy.Reset(0, task, 1);
  EXPECT_THAT(Told(Ask(policy, {0}, task)[0]), HasSubstr("the chunk has 1 targets, wanted 2"));
}

TEST_F(LcmPolicyTest, APolicyThatHangsFailsItsSceneAloneWithTheNumbers) {
  const LcmAddress address = wire::OwnAddress();
  wire::RawServer server(address, [&](LcmLink& link, const observation_t& header) {
    if (header.episode != 1) link.Publish(address.Channel("chunk"), wire::RawServer::Honest(header));
  });
  LcmPolicy policy(Firm(address));
  for (int scene = 0; scene < 3; ++scene) policy.Reset(scene, wire::TwoCameraTask(), 1);
  const auto answers = Ask(policy, {0, 1, 2}, wire::TwoCameraTask());
  EXPECT_EQ(Told(answers[0]), "chunk");
  EXPECT_THAT(Told(answers[1]),
              testing::ContainsRegex("policy_timeout: no answer to request 0 within ([2-9]|[1-9][0-9]+)\\.[0-9] s "
                                     "\\(sent [0-9]+ times; deadline 2 s\\); the policy was last heard"));
  EXPECT_EQ(Told(answers[2]), "chunk");
  EXPECT_EQ(Count(policy.counters(), "timeouts"), 1);
  EXPECT_GE(Count(policy.counters(), "repeats"), 1);
}

/// Takes its time for each of those that ask.
class SlowPolicy : public wire::ProbePolicy {
 public:
  explicit SlowPolicy(double seconds) : seconds_(seconds) {}
  std::vector<Acted> Act(std::span<const SceneObservation> batch) override {
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds_));
    return ProbePolicy::Act(batch);
  }

 private:
  double seconds_;
};

TEST_F(LcmPolicyTest, OneThatAnswersInTurnIsGivenItsTimeForEachOfThoseThatAskTogether) {
  const LcmAddress address = wire::OwnAddress();
  SlowPolicy slow(0.5);
  wire::Served served(slow, wire::ProbeSpec(), address);
  LcmPolicyOptions options = Patient(address);
  options.deadline_s = 2;
  LcmPolicy policy(options);
  const std::vector<SceneId> scenes = {0, 1, 2, 3, 4};
  for (const SceneId scene : scenes) policy.Reset(scene, wire::TwoCameraTask(), 1);
  for (int request = 0; request < 2; ++request) {
    for (const Acted& acted : Ask(policy, scenes, wire::TwoCameraTask())) EXPECT_EQ(Told(acted), "chunk") << request;
  }
  EXPECT_EQ(Count(policy.counters(), "timeouts"), 0);
}

TEST_F(LcmPolicyTest, OneThatOnlyAnswersTheLastRoundsRequestGetsNoMoreTimeForItAndIsSaidTo) {
  const LcmAddress address = wire::OwnAddress();
  wire::RawServer server(address, [&](LcmLink& link, const observation_t& header) {
    chunk_t reply = wire::RawServer::Honest(header);
    reply.request = 0;  // again and again, more often than the deadline
    link.Publish(address.Channel("chunk"), reply);
  });
  int looks = 0;
  LcmPolicyOptions options = Firm(address);
  options.interrupted = [&looks] { return ++looks > 1000; };  // it would wait for ever
  LcmPolicy policy(options);
  policy.Reset(0, wire::TwoCameraTask(), 1);
  EXPECT_EQ(Told(Ask(policy, {0}, wire::TwoCameraTask())[0]), "chunk");
  EXPECT_THAT(Told(Ask(policy, {0}, wire::TwoCameraTask())[0]),
              testing::ContainsRegex("policy_timeout: no answer to request 1 within .*deadline 2 s.*; it sent [0-9]+ "
                                     "answers to earlier requests"));
}

TEST_F(LcmPolicyTest, APolicyThatIsNotThereTimesOut) {
  LcmPolicy policy(Hasty(wire::OwnAddress()));
  policy.Reset(0, wire::TwoCameraTask(), 1);
  EXPECT_THAT(Told(Ask(policy, {0}, wire::TwoCameraTask())[0]),
              testing::ContainsRegex("no answer to the episode's start within .*never heard"));
}

TEST_F(LcmPolicyTest, AProcessThatIsGivenUpIsNotWaitedFor) {
  LcmPolicyOptions options = Patient(wire::OwnAddress());
  options.why_gone = [] { return std::optional<std::string>("exit code 3: no such checkpoint"); };
  LcmPolicy policy(options);
  policy.Reset(0, wire::TwoCameraTask(), 1);
  EXPECT_EQ(Told(Ask(policy, {0}, wire::TwoCameraTask())[0]),
            "policy_error: the policy is gone: exit code 3: no such checkpoint");
  EXPECT_THROW(policy.Handshake(HarnessSpec(wire::TwoCameraTask(), 2), 1000), Error);
}

TEST_F(LcmPolicyTest, ARestartFailsTheEpisodesUnderWayAndNoOthers) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy before, after;
  auto served = std::make_unique<wire::Served>(before, wire::ProbeSpec(), address);
  LcmPolicy policy(Patient(address));
  const Task task = wire::TwoCameraTask();
  policy.Reset(0, task, 1);
  policy.Reset(1, task, 1);
  for (const Acted& acted : Ask(policy, {0, 1}, task)) EXPECT_EQ(Told(acted), "chunk");
  served.reset();
  served = std::make_unique<wire::Served>(after, wire::ProbeSpec(), address);
  policy.Reset(1, task, 1);
  const auto answers = Ask(policy, {0, 1}, task);
  EXPECT_THAT(Told(answers[0]), HasSubstr("policy_error: the policy was restarted in the middle of the episode"));
  EXPECT_EQ(Told(answers[1]), "chunk");
}

TEST_F(LcmPolicyTest, OneThatIsStartedAgainAndDeclaresOtherwiseFailsItsEpisodesWithWhatChanged) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe, again, other;
  auto served = std::make_unique<wire::Served>(probe, wire::ProbeSpec(), address);
  LcmPolicy policy(Patient(address));
  const Task task = wire::TwoCameraTask();
  policy.Handshake(HarnessSpec(task, 2), 30);
  served.reset();
  served = std::make_unique<wire::Served>(again, wire::ProbeSpec(), address);
  policy.Reset(0, task, 1);
  EXPECT_EQ(Told(Ask(policy, {0}, task)[0]), "chunk") << "the same declaration";
  served.reset();
  PolicySpec changed = wire::ProbeSpec(4);
  changed.checkpoint = "c2";
  served = std::make_unique<wire::Served>(other, changed, address);
  policy.Reset(0, task, 1);
  policy.Reset(1, task, 1);
  for (const Acted& acted : Ask(policy, {0, 1}, task)) {
    EXPECT_EQ(Told(acted),
              "policy_error: the policy was started again and declares otherwise: checkpoint was c1, is c2; chunk_size "
              "was 2, is 4");
  }
}

TEST_F(LcmPolicyTest, AReplyToTheLastRequestIsNotTakenForAReplyToThisOne) {
  const LcmAddress address = wire::OwnAddress();
  wire::RawServer server(address, [&](LcmLink& link, const observation_t& header) {
    chunk_t old = wire::RawServer::Honest(header), reply = old;
    old.request -= 1;
    old.targets[0][0].closure = 1;
    reply.sequence = header.request + 1;
    old.sequence = header.request;
    if (header.request > 0) link.Publish(address.Channel("chunk"), old);
    link.Publish(address.Channel("chunk"), reply);
  });
  LcmPolicy policy(Patient(address));
  policy.Reset(0, wire::TwoCameraTask(), 1);
  for (int request = 0; request < 3; ++request) {
    const auto answers = Ask(policy, {0}, wire::TwoCameraTask());
    ASSERT_EQ(Told(answers[0]), "chunk");
    EXPECT_EQ(std::get<ActionChunk>(answers[0]).targets[0][0].closure, 0.25);
  }
  EXPECT_EQ(Count(policy.counters(), "stale_replies"), 2);
}

TEST_F(LcmPolicyTest, WhatIsNoAnswerToThisRequestIsCountedByItsKind) {
  const LcmAddress address = wire::OwnAddress();
  const LcmAddress stranger{address.url, "stranger"};
  wire::RawServer server(address, [&](LcmLink& link, const observation_t& header) {
    const chunk_t honest = wire::RawServer::Honest(header);
    if (header.episode == 1) return link.Publish(address.Channel("chunk"), honest);
    chunk_t foreign = honest;
    foreign.client = "somebody else";
    link.Publish(address.Channel("chunk"), foreign);
    link.Publish(stranger.Channel("chunk"), honest);
    foreign = honest;
    foreign.server = "impostor";
    link.Publish(address.Channel("chunk"), foreign);
    link.PublishBytes(address.Channel("chunk"), std::vector<std::uint8_t>(40));
    chunk_t first = honest, second = honest;
    second.sequence = 7;
    first.sequence = 6;
    link.Publish(address.Channel("chunk"), second);
    link.Publish(address.Channel("chunk"), first);  // a duplicate, and overtaken
  });
  LcmPolicy policy(Patient(address));
  policy.Reset(0, wire::TwoCameraTask(), 1);
  policy.Reset(1, wire::TwoCameraTask(), 1);
  for (const SceneId scene : {0, 1}) EXPECT_EQ(Told(Ask(policy, {scene}, wire::TwoCameraTask())[0]), "chunk");
  EXPECT_EQ(Count(policy.counters(), "foreign_replies"), 3);
  EXPECT_EQ(Count(policy.counters(), "undecodable_replies"), 1);
  EXPECT_EQ(Count(policy.counters(), "duplicate_replies"), 1);
  EXPECT_GE(Count(policy.counters(), "reordered_replies"), 1);
}

TEST_F(LcmPolicyTest, AnAnswerAfterTheDeadlineIsLateAndHarmsNoOther) {
  const LcmAddress address = wire::OwnAddress();
  std::optional<chunk_t> held;
  wire::RawServer server(address, [&](LcmLink& link, const observation_t& header) {
    if (header.episode == 0) return void(held = wire::RawServer::Honest(header));
    link.Publish(address.Channel("chunk"), *held);
    link.Publish(address.Channel("chunk"), wire::RawServer::Honest(header));
  });
  LcmPolicyOptions options = Firm(address);
  options.repeat_after_s = 20;
  LcmPolicy policy(options);
  policy.Reset(0, wire::TwoCameraTask(), 1);
  EXPECT_THAT(Told(Ask(policy, {0}, wire::TwoCameraTask())[0]), HasSubstr("policy_timeout"));
  policy.Reset(0, wire::TwoCameraTask(), 1);
  EXPECT_EQ(Told(Ask(policy, {0}, wire::TwoCameraTask())[0]), "chunk");
  EXPECT_EQ(Count(policy.counters(), "late_replies"), 1);
}

TEST_F(LcmPolicyTest, OneThatLeavesSeveralWaitingIsRestartedOnceAndAgainIfItGoesOn) {
  int restarts = 0;
  LcmPolicyOptions options = Hasty(wire::OwnAddress());
  options.restart = [&](auto) { ++restarts; };
  LcmPolicy policy(options);
  for (int round = 1; round <= 2; ++round) {
    for (const SceneId scene : {0, 1, 2}) policy.Reset(scene, wire::TwoCameraTask(), 1);
    for (const Acted& acted : Ask(policy, {0, 1, 2}, wire::TwoCameraTask()))
      EXPECT_THAT(Told(acted), HasSubstr("policy_timeout"));
    EXPECT_EQ(restarts, round);
  }
}

TEST_F(LcmPolicyTest, AStartMayTakeLongerThanAnAnswer) {
  LcmPolicyOptions options = Hasty(wire::OwnAddress());
  options.start_s = 0.6;
  LcmPolicy policy(options);
  policy.Reset(0, wire::TwoCameraTask(), 1);
  EXPECT_THAT(Told(Ask(policy, {0}, wire::TwoCameraTask())[0]),
              testing::ContainsRegex("no answer to the episode's start within (0\\.[6-9]|[1-9][0-9]*\\.[0-9]) s "
                                     ".*deadline 0\\.6 s"));
}

TEST_F(LcmPolicyTest, WhoeverWaitsIsSentAwayWhenTheUserWantsAnEnd) {
  LcmPolicyOptions options = Patient(wire::OwnAddress());
  options.interrupted = [] { return true; };
  LcmPolicy policy(options);
  policy.Reset(0, wire::TwoCameraTask(), 1);
  EXPECT_EQ(Told(Ask(policy, {0}, wire::TwoCameraTask())[0]), "policy_error: interrupted");
  EXPECT_THROW(policy.Handshake(HarnessSpec(wire::TwoCameraTask(), 2), 1000), Error);
}

TEST_F(LcmPolicyTest, ALongerChunkIsKeptWholeWhereThatIsWantedAndItsTimeIsMeasured) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe(5);
  wire::Served served(probe, wire::ProbeSpec(5), address);
  LcmPolicyOptions options = Patient(address);
  options.keep_longer_chunks = true;
  LcmPolicy policy(options);
  policy.Handshake(HarnessSpec(wire::TwoCameraTask(), 2), 30);
  policy.Reset(0, wire::TwoCameraTask(), 1);
  const auto answers = Ask(policy, {0}, wire::TwoCameraTask());
  ASSERT_EQ(Told(answers[0]), "chunk");
  EXPECT_EQ(std::get<ActionChunk>(answers[0]).targets.size(), 5u);
  EXPECT_GT(std::get<ActionChunk>(answers[0]).thinking_s, 0);
}

TEST_F(LcmPolicyTest, TwoRunsOnOneMachineDoNotHearEachOther) {
  const LcmAddress left = wire::OwnAddress("left"), right = wire::OwnAddress("right"), same_port{left.url, right.token};
  wire::ProbePolicy one, other, third;
  wire::Served first(one, wire::ProbeSpec(), left), second(other, wire::ProbeSpec(), right),
      neighbour(third, wire::ProbeSpec(), same_port);
  LcmPolicy a(Patient(left)), b(Patient(right)), c(Patient(same_port));
  const Task task = wire::TwoCameraTask();
  for (LcmPolicy* policy : {&a, &b, &c}) {
    policy->Reset(0, task, 1);
    EXPECT_EQ(Told(Ask(*policy, {0}, task)[0]), "chunk");
  }
  EXPECT_EQ(one.seen().at(0).observations.size(), 1u);
  EXPECT_EQ(other.seen().at(0).observations.size(), 1u);
  EXPECT_EQ(third.seen().at(0).observations.size(), 1u);
  EXPECT_EQ(Count(b.counters(), "foreign_replies"), 0);  // another port: nothing comes
  EXPECT_GE(Count(c.counters(), "foreign_replies"), 1);  // the same port: it comes, and is known for what it is
  EXPECT_GE(Count(first.counters(), "foreign_messages"), 1);
  EXPECT_EQ(Count(second.counters(), "foreign_messages"), 0);
}

TEST_F(LcmPolicyTest, OptionsOutOfRangeAreRefused) {
  LcmPolicyOptions options = Patient(wire::OwnAddress());
  options.jpeg_quality = 101;
  EXPECT_THROW(LcmPolicy{options}, Error);
  options = Patient({.token = "no spaces"});
  EXPECT_THROW(LcmPolicy{options}, Error);
}

TEST_F(LcmPolicyTest, AWaitBeyondWhatTheClockCountsIsRefused) {
  using Options = LcmPolicyOptions;
  for (double Options::* wait_s : {&Options::deadline_s, &Options::start_s, &Options::repeat_after_s}) {
    Options options = Patient(wire::OwnAddress());
    options.*wait_s = 1e10;
    EXPECT_THROW(LcmPolicy{options}, Error);
  }
}

}  // namespace
}  // namespace evac
