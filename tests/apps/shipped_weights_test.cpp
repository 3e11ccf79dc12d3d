#include <gtest/gtest.h>

#include <filesystem>

#include "judges/classifier_judge.h"
#include "policies/learned_policy.h"
#include "worldmodel/trained_for.h"

/// What ships opens, and stays small.
namespace evac {
namespace {

const std::filesystem::path kShipped = EVAC_SOURCE_DIR "/worldmodel/weights/desk";

TEST(ShippedWeights, OpenAsWhatTheyAreCalled) {
  std::size_t policies = 0, judges = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kShipped)) {
    SCOPED_TRACE(entry.path());
    const std::string stem = entry.path().stem();
    if (stem.starts_with("policy")) {
      const LearnedPolicy policy(entry.path(), 8);
      EXPECT_EQ(policy.Spec().checkpoint, stem);
      EXPECT_EQ(policy.Spec().period_s, 0.1);
      ++policies;
    } else if (stem.starts_with("judge")) {
      EXPECT_NO_THROW(ClassifierJudge(entry.path(), kShipped));
      ++judges;
    }
  }
  EXPECT_GE(policies, 4U) << "checkpoints of one training";
  EXPECT_GE(judges, 1U);
}

TEST(ShippedWeights, OfTheWorldModelSayWhatTheyAreFor) {
  const TrainedFor trained = TrainedFor::Read(kShipped / "evac.safetensors");
  EXPECT_EQ(trained.period_s, 0.1);
  EXPECT_EQ(trained.cameras, (std::vector<std::string>{"head", "hand_right"}));
  EXPECT_EQ(trained.arms, (std::vector<std::string>{"right"}));
  EXPECT_EQ(trained.arms_read, "told");
  ASSERT_TRUE(trained.statistics.has_value());
  EXPECT_NO_THROW(trained.StatisticsOr(kShipped / "statistics.yaml"));
}

TEST(ShippedWeights, AreAtMost25MBInAll) {
  std::uintmax_t bytes = 0;
  for (const auto& entry : std::filesystem::directory_iterator(kShipped)) bytes += entry.file_size();
  EXPECT_LE(bytes, 25'000'000U);
}

}  // namespace
}  // namespace evac
