#include "core/types.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "core/error.h"

namespace evac {
namespace {

TEST(Types, EveryStopReasonAndLabelHasANameThatLeadsBack) {
  for (const StopReason reason :
       {StopReason::kStill, StopReason::kMaxChunks, StopReason::kRecordingEnd, StopReason::kPolicyError,
        StopReason::kPolicyTimeout, StopReason::kWorldError, StopReason::kDiverged}) {
    EXPECT_EQ(StopReasonFromName(Name(reason)), reason);
  }
  for (const Label label : {Label::kSuccess, Label::kFailure, Label::kCannotTell, Label::kInvalid})
    EXPECT_EQ(LabelFromName(Name(label)), label);
  EXPECT_THROW(StopReasonFromName("Still"), Error);
  EXPECT_THROW(LabelFromName(""), Error);
}

TEST(Types, AnEpisodeThatCameToItsEndHasNotFailed) {
  for (const StopReason end : {StopReason::kStill, StopReason::kMaxChunks, StopReason::kRecordingEnd})
    EXPECT_FALSE(IsFailure(end));
  for (const StopReason failure :
       {StopReason::kPolicyError, StopReason::kPolicyTimeout, StopReason::kWorldError, StopReason::kDiverged}) {
    EXPECT_TRUE(IsFailure(failure));
  }
}

TEST(Types, AnEpisodesIdIsItsPath) {
  const EpisodeKey key{{"take_bottle", "41-0007", "visual_pick", "good", 1}, "real"};
  EXPECT_EQ(key.Id(), "real/take_bottle/visual_pick@good/41-0007-s1");
}

TEST(Types, EpisodesAreOrderedByTheirPairAndThenByWorld) {
  const std::vector<EpisodeKey> ordered = {{{"a", "1", "p", "c", 2}, "sim"},  {{"a", "1", "p", "c", 10}, "real"},
                                           {{"a", "1", "p", "c", 10}, "sim"}, {{"a", "1", "p", "d", 0}, "real"},
                                           {{"a", "1", "q", "c", 0}, "real"}, {{"a", "2", "p", "c", 0}, "real"},
                                           {{"b", "1", "p", "c", 0}, "real"}};
  EXPECT_TRUE(std::is_sorted(ordered.begin(), ordered.end()));
}

}  // namespace
}  // namespace evac
