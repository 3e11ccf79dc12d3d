#include <gtest/gtest.h>

#include <chrono>
#include <optional>
#include <thread>

#include "policies/lcm_policy.h"
#include "tests/policies/wire_support.h"

namespace evac {
namespace {

using wire::Count;
using wire::Told;

/// Policies that take long to begin, or that never do.
class LcmPolicyStarts : public wire::WireTest {};

/// Takes its time to begin each episode.
class SlowlyBeginningPolicy : public wire::ProbePolicy {
 public:
  explicit SlowlyBeginningPolicy(double seconds) : seconds_(seconds) {}
  void Reset(SceneId scene, const Task& task, std::uint64_t seed) override {
    std::this_thread::sleep_for(std::chrono::duration<double>(seconds_));
    ProbePolicy::Reset(scene, task, seed);
  }

 private:
  double seconds_;
};

/// The first whose start was acknowledged had the time of an answer while the policy began the others' episodes: with
/// several lanes it was taken to hang, and was ended.
TEST_F(LcmPolicyStarts, OneThatBeginsEpisodesInTurnIsGivenTheTimeOfAStartForEachAlsoByThoseThatHaveBegun) {
  const LcmAddress address = wire::OwnAddress();
  SlowlyBeginningPolicy slow(2.5);
  wire::Served served(slow, wire::ProbeSpec(), address);
  LcmPolicyOptions options{.address = address, .deadline_s = 2, .start_s = 60, .repeat_after_s = 20};
  int restarts = 0;
  options.restart = [&](auto) { ++restarts; };
  LcmPolicy policy(options);
  const std::vector<SceneId> scenes = {0, 1, 2};
  for (const SceneId scene : scenes) policy.Reset(scene, wire::TwoCameraTask(), 1);
  for (const Acted& acted : Ask(policy, scenes)) EXPECT_EQ(Told(acted), "chunk");
  EXPECT_EQ(Count(policy.counters(), "timeouts"), 0);
  EXPECT_EQ(restarts, 0);
}

TEST_F(LcmPolicyStarts, WhoeverRestartsItIsToldWhenItWasAsked) {
  LcmPolicyOptions options{.address = wire::OwnAddress(), .deadline_s = 0.2, .repeat_after_s = 0.05};
  std::optional<std::chrono::steady_clock::time_point> told;
  options.restart = [&](auto asked) { told = asked; };
  LcmPolicy policy(options);
  policy.Reset(0, wire::TwoCameraTask(), 1);
  const auto before = std::chrono::steady_clock::now();
  Ask(policy, {0});
  ASSERT_TRUE(told);
  EXPECT_GE(*told, before);
  EXPECT_LE(*told + std::chrono::milliseconds(200), std::chrono::steady_clock::now()) << "the deadline has passed since";
}

}  // namespace
}  // namespace evac
