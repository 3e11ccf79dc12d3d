#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/train/prepared_world.h"

namespace evac::train {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(TrainWorld, RefusesMapsOfAnotherSizeThanThePages) {
  Prepared at(1);
  const auto train = [&](const char* out) {
    TrainWorld({{at.folder / "shards"}, at.folder / out, at.config}, Quick(1), {at.codec()}, {});
  };
  EXPECT_NO_THROW(train("published"));
  at.config.pose_map.scaled = true;
  EXPECT_THAT([&] { train("scaled"); },
              ThrowsMessage<TensorError>(AllOf(HasSubstr("drawn with 'radius_px=50 thickness_px=8'"),
                                               HasSubstr("wants 'radius_px=3 thickness_px=1'"))));
}

TEST(TrainWorld, RefusesWhatAWorldModelImagined) {
  const Prepared at(1);
  const auto train = [&] {
    TrainWorld({{at.folder / "shards"}, at.folder / "out", at.config}, Quick(1), {at.codec()}, {});
  };
  at.Encode("float32, imagined by 0123abcd in 2 steps");
  EXPECT_THAT(train, ThrowsMessage<TensorError>(HasSubstr("wanted a folder of `evac encode` without --imagined")));
  at.Encode("bfloat16");
  EXPECT_NO_THROW(train());
}

TEST(TrainWorld, DoesNotGoOnWithLatentsThatWereComputedOtherwise) {
  const Prepared at(1);
  int left = 0;
  JobPlace place{{at.folder / "shards"}, at.folder / "out", at.config};
  place.interrupted = [&] { return left-- == 0; };
  const auto go_on = [&](int steps) {
    left = steps;
    return TrainWorld(place, Quick(6), {at.codec()}, {}).why;
  };
  EXPECT_EQ(go_on(2), "interrupted");
  at.Encode("bfloat16");
  EXPECT_THAT([&] { go_on(2); }, ThrowsMessage<TensorError>(HasSubstr("is a training with other options")));
  at.Encode("float32");
  EXPECT_EQ(go_on(100), "done") << "the same latents again";
}

TEST(TrainWorld, RefusesLatentsOfAnEarlierPacking) {
  const Prepared at(1);
  WriteSyntheticShards(at.folder / "shards", {.frames = 9, .seed = 2});
  const auto train = [&] {
    TrainWorld({{at.folder / "shards"}, at.folder / "out", at.config}, Quick(1), {at.codec()}, {});
  };
  EXPECT_THAT(train,
              ThrowsMessage<TensorError>(AllOf(HasSubstr("latents_00000.safetensors was made of another packing"),
                                               HasSubstr("wanted `evac encode` again"))));
  at.Encode("float32");
  EXPECT_NO_THROW(train());
}

}  // namespace
}  // namespace evac::train
