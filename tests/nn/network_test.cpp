#include <ATen/ops/zeros_like.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/nn/support.h"
#include "worldmodel/nn/attention.h"
#include "worldmodel/nn/imagine.h"

namespace evac::nn {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

class Network : public testing::Test {
 protected:
  Network() : model_(weights_, TinyConfig()) {}

  /// One call of the denoiser for some scenes and views, from the seeds of its rows.
  Tensor Denoised(const std::vector<std::uint64_t>& row_seeds, std::int64_t views) const {
    std::vector<Tensor> x, tokens;
    for (const std::uint64_t seed : row_seeds) {
      x.push_back(Noise({1, 19, 5, 8, 12}, seed));
      tokens.push_back(Noise({1, 7, 32}, 1000 + seed / 10 * 10));  // the ten seeds of a scene share their actions
    }
    const auto scenes = static_cast<std::int64_t>(row_seeds.size()) / views;
    const auto constant = [](std::int64_t count, std::int64_t value) { return at::full({count}, value, at::kLong); };
    const PreparedContext context =
        model_.unet().Prepare({at::cat(tokens, 0), constant(scenes, 2), constant(scenes, 11), views});
    return model_.unet()({at::cat(x, 0), constant(scenes * views, 481), views, 2}, context);
  }

  at::NoGradGuard no_gradients_;
  HashWeights weights_;
  EvacModel model_;
};

TEST_F(Network, PermutingViewsPermutesItsAnswers) {
  const Tensor straight = Denoised({10, 11, 12}, 3), turned = Denoised({12, 10, 11}, 3);
  EXPECT_LT(LargestDifference(turned, at::stack({straight[2], straight[0], straight[1]})), 2e-5);
  EXPECT_GT(LargestDifference(turned, straight), 1e-2) << "views that all answer alike would pass too";
}

TEST_F(Network, ViewsSeeEachOther) {
  EXPECT_GT(LargestDifference(Denoised({10, 11}, 2)[0], Denoised({10, 13}, 2)[0]), 1e-4);
}

/// To rounding. Where this was measured they are the same to the last bit; which order a library sums in is its own.
TEST_F(Network, ThreeScenesTogetherAreThreeAlone) {
  const Tensor together = Denoised({10, 20, 30}, 1);
  for (const int i : {0, 1, 2}) {
    const Tensor alone = Denoised({static_cast<std::uint64_t>(10 * (i + 1))}, 1)[0];
    EXPECT_LT(LargestDifference(together[i], alone), 5e-6) << i;
    EXPECT_GT(LargestDifference(together[(i + 1) % 3], alone), 1e-2) << "scenes that all answer alike would pass too";
  }
}

/// Another source's weights in half the bytes.
class HalfWeights final : public ParameterSource {
 public:
  /// @param products  of which type they are; nothing: that of the weights
  explicit HalfWeights(ParameterSource& source, at::ScalarType type = at::kBFloat16,
                       std::optional<at::ScalarType> products = std::nullopt)
      : source_(source), type_(type), products_(products) {}
  Tensor Take(const std::string& key, at::IntArrayRef shape) override { return source_.Take(key, shape).to(type_); }
  std::optional<at::ScalarType> ProductType() const override { return products_; }

 private:
  ParameterSource& source_;
  at::ScalarType type_;
  std::optional<at::ScalarType> products_;
};

TEST_F(Network, InHalfTheBytesItSaysNearlyTheSame) {
  HalfWeights halves(weights_);
  const EvacModel half(halves, TinyConfig());
  const Tensor x = Noise({1, 19, 5, 8, 12}, 10), tokens = Noise({1, 7, 32}, 1010), fps = at::full({1}, 2, at::kLong);
  const auto denoised = [&](const EvacModel& model) {
    return model.unet()({x, at::full({1}, 481, at::kLong), 1, 2}, model.unet().Prepare({tokens, fps, fps, 1}));
  };
  const auto relative = [](const Tensor& a, const Tensor& b) { return ((a - b).norm() / b.norm()).item<double>(); };
  const Tensor exact = denoised(model_), coarse = denoised(half);
  EXPECT_EQ(coarse.scalar_type(), at::kFloat);
  EXPECT_LT(relative(coarse, exact), .05);
  EXPECT_GT(relative(coarse, exact), 1e-5) << "nothing was halved";
  const Tensor pictures = Noise({1, 3, 64, 96}, 5);
  EXPECT_LT(relative(half.ImageTokens(pictures), model_.ImageTokens(pictures)), .05);
  const Tensor latents = Noise({1, 4, 8, 12}, 6);
  EXPECT_LT(relative(DecodeLatents(half, latents), DecodeLatents(model_, latents)), .05);
}

/// libtorch multiplies no f16 on a processor, so the products here are floats; everything between them is as on a GPU.
TEST_F(Network, WithWeightsInF16ComputesInFloatsBetweenItsProducts) {
  HalfWeights halves(weights_, at::kHalf, at::kFloat);
  const EvacModel half(halves, TinyConfig());
  const Tensor x = Noise({1, 19, 5, 8, 12}, 10), tokens = Noise({1, 7, 32}, 1010), fps = at::full({1}, 2, at::kLong);
  const auto denoised = [&](const EvacModel& model) {
    return model.unet()({x, at::full({1}, 481, at::kLong), 1, 2}, model.unet().Prepare({tokens, fps, fps, 1}));
  };
  const auto relative = [](const Tensor& a, const Tensor& b) { return ((a - b).norm() / b.norm()).item<double>(); };
  EXPECT_EQ(denoised(half).scalar_type(), at::kFloat);
  EXPECT_LT(relative(denoised(half), denoised(model_)), .01);
  EXPECT_GT(relative(denoised(half), denoised(model_)), 1e-6) << "nothing was halved";
  const Tensor latents = Noise({1, 4, 8, 12}, 6), deltas = Noise({1, 3, 14}, 3);
  EXPECT_LT(relative(DecodeLatents(half, latents), DecodeLatents(model_, latents)), .01);
  EXPECT_LT(relative(half.ActionTokens(deltas), model_.ActionTokens(deltas)), .01);
}

TEST_F(Network, WithWeightsInF16TheImageEncoderCutsItsPatchesInFloats) {
  HalfWeights halves(weights_, at::kHalf, at::kFloat);
  ImageEncoderConfig config = TinyConfig().image_encoder;
  config.layers = 0;  // up to the first block, whose products are in the type of its weights
  const ImageEncoder half(Scope(halves, "embedder.model.visual"), config),
      whole(Scope(weights_, "embedder.model.visual"), config);
  const Tensor picture = Noise({1, 3, 28, 28}, 5);
  EXPECT_EQ(half(picture).scalar_type(), at::kFloat);
  EXPECT_LT(LargestDifference(half(picture), whole(picture)), .01);
}

TEST(Precise, RaisesHalvesOfBothKindsToFloatsAndLeavesOthersAsTheyAre) {
  const Tensor whole = Noise({5}, 1);
  for (const at::ScalarType type : {at::kHalf, at::kBFloat16}) {
    EXPECT_EQ(Precise(whole.to(type)).scalar_type(), at::kFloat);
    EXPECT_TRUE(Precise(whole.to(type)).equal(whole.to(type).to(at::kFloat)));
  }
  EXPECT_TRUE(Precise(whole).is_same(whole));
  EXPECT_EQ(Precise(whole.to(at::kDouble)).scalar_type(), at::kDouble);
}

TEST_F(Network, AnswersTheSameBitsTwice) { EXPECT_TRUE(Denoised({10, 20}, 1).equal(Denoised({10, 20}, 1))); }

TEST_F(Network, TheOrderOfActionsIsInvisibleToIt) {
  const Tensor deltas = Noise({1, 3, 14}, 3);
  const Tensor turned = deltas.index_select(1, at::tensor({2, 0, 1}));
  EXPECT_LT(LargestDifference(model_.ActionTokens(deltas), model_.ActionTokens(turned)), 1e-5);
}

TEST_F(Network, TheCodecTakesAwayItsStrideAndGivesItBack) {
  const Tensor images = Noise({3, 3, 16, 24}, 1);
  const Tensor latents = EncodeImages(model_, images, {});
  EXPECT_EQ(latents.sizes(), (at::IntArrayRef{3, 4, 8, 12}));
  EXPECT_EQ(DecodeLatents(model_, latents).sizes(), images.sizes());
}

ChunkRequest Request(std::int64_t scenes) {
  const std::int64_t rows = scenes;
  return {Noise({rows, 4, 2, 8, 12}, 1), Noise({rows, 3, 16, 24}, 2),   Noise({rows, 4, 3, 8, 12}, 3),
          Noise({rows, 3, 5, 8, 12}, 4), Noise({rows, 3, 5, 8, 12}, 5), Noise({scenes, 3, 14}, 6)};
}

TEST_F(Network, GuidanceLeavesActionsMapsAndRaysAndTakesTheImageAway) {
  const ChunkRequest request = Request(2);
  const Conditioning with = Condition(model_, request), without = Unconditioned(model_, request, with);
  EXPECT_TRUE(with.concat.pose_map.equal(without.concat.pose_map));
  EXPECT_TRUE(with.concat.direction.equal(without.concat.direction));
  EXPECT_TRUE(with.tokens.narrow(1, 4, 3).equal(without.tokens.narrow(1, 4, 3)));
  EXPECT_FALSE(with.tokens.narrow(1, 0, 4).equal(without.tokens.narrow(1, 0, 4)));
  EXPECT_EQ(without.concat.mask.narrow(2, 2, 3).abs().sum().item<double>(), 0);
  EXPECT_TRUE(without.concat.image.narrow(2, 0, 2).equal(request.memory));
  EXPECT_EQ(with.concat.pose_map.narrow(2, 0, 2).abs().sum().item<double>(), 0);
}

ModelConfig CountsFromTheLastFrame(double unchanged_below) {
  ModelConfig config = TinyConfig();
  config.schedule.from_last_frame = true;
  config.schedule.unchanged_below = unchanged_below;
  return config;
}

TEST(Unchanged, IsWhatIsNearerThanTheLimitAndInPartWhatIsNearerThanTwice) {
  const NoiseSchedule schedule(CountsFromTheLastFrame(0.2).schedule);
  const Tensor still = Noise({1, 2, 1, 1, 4}, 1);
  Tensor change = at::zeros_like(still);  // of four places: two numbers each
  const float far[] = {0.19F, 0.3F, 0.41F, 3.0F};
  for (int place = 0; place < 4; ++place) {
    change[0][0][0][0][place] = far[place];
    change[0][1][0][0][place] = -far[place];  // the root mean square is `far`
  }
  const Tensor left = LeaveUnchanged(schedule, still + change, still) - still;
  EXPECT_EQ(left[0][0][0][0][0].item<float>(), 0);
  EXPECT_EQ(left[0][1][0][0][0].item<float>(), 0);
  EXPECT_NEAR(left[0][0][0][0][1].item<float>(), 0.15, 1e-5) << "half way between once and twice";
  for (const int place : {2, 3}) {
    EXPECT_NEAR(left[0][0][0][0][place].item<float>(), far[place], 1e-5);
    EXPECT_NEAR(left[0][1][0][0][place].item<float>(), -far[place], 1e-5);
  }
  const NoiseSchedule off(CountsFromTheLastFrame(0).schedule);
  EXPECT_TRUE(LeaveUnchanged(off, still + change, still).equal(still + change));
}

TEST(Schedule, OfOneStepCannotEndInNoSignal) {
  ModelConfig config = CountsFromTheLastFrame(0.2);
  config.schedule.steps = 1;
  EXPECT_THAT([&] { config.Check(); },
              testing::ThrowsMessage<TensorError>(
                  testing::HasSubstr("schedule.steps is 1, wanted 2 or more with schedule.zero_terminal_snr")));
  config.schedule.zero_terminal_snr = false;
  EXPECT_NO_THROW(config.Check());
}

TEST(Unchanged, IsALimitAboveNothingAndOfWhatIsCountedFromTheLastFrame) {
  EXPECT_NO_THROW(CountsFromTheLastFrame(0.2).Check());
  EXPECT_THAT([] { CountsFromTheLastFrame(-0.1).Check(); },
              testing::ThrowsMessage<TensorError>(testing::HasSubstr("found -0.1, wanted 0")));
  EXPECT_THROW(CountsFromTheLastFrame(std::nan("")).Check(), TensorError);
  ModelConfig config = CountsFromTheLastFrame(0.2);
  config.schedule.from_last_frame = false;
  EXPECT_THROW(config.Check(), TensorError);
}

/// Of two ends, `share` of the time 1 and else 0, in all channels of a place: which answer errs least.
double LeastErring(double share, double squared_below) {
  double best = 0, least = INFINITY;
  for (int i = 0; i <= 100; ++i) {
    const double answer = i / 100.0;
    const auto error = [&](double end) {
      return ErrorsOfPlaces(at::full({1, 3, 1, 1, 1}, answer), at::full({1, 3, 1, 1, 1}, end), squared_below)
          .item<double>();
    };
    const double mean = share * error(1) + (1 - share) * error(0);
    if (mean < least) least = mean, best = answer;
  }
  return best;
}

TEST(ErrorsOfPlaces, SquaredAskForTheMeanOfTwoEndsAndBySizeForTheLikelier) {
  EXPECT_NEAR(LeastErring(0.6, 0), 0.6, 1e-9);
  EXPECT_GT(LeastErring(0.6, 0.1), 0.85);
  EXPECT_LT(LeastErring(0.4, 0.1), 0.15);
  EXPECT_NEAR(LeastErring(0.6, 100), 0.6, 0.02) << "far below the limit errors are squared";
}

TEST(ErrorsOfPlaces, AreOfAllChannelsTogether) {
  const Tensor wanted = Noise({2, 4, 3, 2, 2}, 1), found = Noise({2, 4, 3, 2, 2}, 2);
  const Tensor squared = (found - wanted).square().mean(1, true);
  EXPECT_LT(LargestDifference(ErrorsOfPlaces(found, wanted, 0), squared), 1e-6);
  const Tensor errors = ErrorsOfPlaces(found, wanted, 0.5);
  EXPECT_EQ(errors.sizes(), squared.sizes());
  EXPECT_TRUE((errors < squared).all().item<bool>());
  EXPECT_LT(LargestDifference(errors, (squared + 0.25).sqrt() - 0.5), 1e-6);
  EXPECT_EQ(ErrorsOfPlaces(wanted, wanted, 0.5).abs().max().item<double>(), 0);
}

TEST_F(Network, WhatChangesByLittleDoesNotAddUp) {
  const ChunkRequest request = Request(1);
  ImagineOptions options;
  options.steps = 2;
  const auto imagined = [&](double unchanged_below) {
    HashWeights weights;
    const EvacModel model(weights, CountsFromTheLastFrame(unchanged_below));
    const DrawNoise step = [] { return Noise({1, 4, 5, 8, 12}, 8); };
    return ImagineChunk(model, request, {Noise({1, 4, 3, 8, 12}, 7), step}, options);
  };
  const Tensor still = request.memory.narrow(2, 1, 1).expand({-1, -1, 3, -1, -1});
  const Tensor free = imagined(0), held = imagined(10);
  EXPECT_GT(LargestDifference(free.narrow(2, 2, 3), still), 1e-3);
  EXPECT_TRUE(held.narrow(2, 2, 3).equal(still)) << "as far as this network's answers reach";
  EXPECT_TRUE(held.narrow(2, 0, 2).equal(request.memory));
}

TEST_F(Network, AChunkStartsWithItsMemoryUntouched) {
  const ChunkRequest request = Request(1);
  for (const Solver solver : {Solver::kDdim, Solver::kDpmSolver}) {
    ImagineOptions options;
    options.solver = solver;
    options.steps = 3;
    const Tensor latents = ImagineChunk(model_, request,
                                        {Noise({1, 4, 3, 8, 12}, 7),
                                         [] {
                                           return Noise({1, 4, 5, 8, 12}, 8);
                                         }},
                                        options);
    EXPECT_EQ(latents.sizes(), (at::IntArrayRef{1, 4, 5, 8, 12}));
    EXPECT_TRUE(latents.narrow(2, 0, 2).equal(request.memory));
    EXPECT_TRUE(latents.isfinite().all().item<bool>());
  }
}

TEST(Attention, TiledIsPlain) {
  const at::NoGradGuard no_gradients;
  for (const auto& [length, context, heads, width] :
       {std::array<std::int64_t, 4>{1, 1, 1, 8}, {7, 3, 2, 32}, {130, 257, 3, 48}, {600, 600, 2, 128}}) {
    const Tensor q = Noise({2, length, width}, 1) * 3, k = Noise({2, context, width}, 2),
                 v = Noise({2, context, width}, 3);
    EXPECT_LT(LargestDifference(Attention(q, k, v, heads), PlainAttention(q, k, v, heads)), 1e-5) << length;
  }
}

/// All scores of a picture of the published size lay in memory at once: gigabytes for each scene.
TEST(Attention, OfBf16IsTiledToo) {
  const at::NoGradGuard no_gradients;
  const auto halved = [](std::int64_t length, std::uint64_t seed) { return Noise({2, length, 64}, seed).to(at::kBFloat16); };
  const Tensor q = halved(600, 1), k = halved(400, 2), v = halved(400, 3);
  const Tensor exact = Attention(q.to(at::kFloat), k.to(at::kFloat), v.to(at::kFloat), 2);
  const Tensor found = Attention(q, k, v, 2);
  EXPECT_EQ(found.scalar_type(), at::kBFloat16);
  EXPECT_TRUE(found.equal(exact.to(at::kBFloat16))) << "nothing between is in bf16";
}

TEST(Attention, OverTimeIsAttentionOfEachPixel) {
  const at::NoGradGuard no_gradients;
  const Tensor q = Noise({2, 5, 3, 32}, 1), k = Noise({2, 5, 3, 32}, 2), v = Noise({2, 5, 3, 32}, 3);
  const Tensor all = TemporalAttention(q, k, v, 2);
  for (const std::int64_t pixel : {0, 1, 2}) {
    const Tensor one = PlainAttention(q.select(2, pixel), k.select(2, pixel), v.select(2, pixel), 2);
    EXPECT_LT(LargestDifference(all.select(2, pixel), one), 2e-6);
  }
}

TEST(CausalConv, SeesNothingOfTheFuture) {
  HashWeights weights;
  const CausalConv conv(Scope(weights, "conv"), 32);
  const Tensor x = Noise({1, 6, 4, 32}, 1);
  Tensor changed = x.clone();
  changed.narrow(1, 4, 2).add_(1);
  const Tensor before = conv(x), after = conv(changed);
  EXPECT_TRUE(before.narrow(1, 0, 4).equal(after.narrow(1, 0, 4)));
  EXPECT_FALSE(before[0][4].equal(after[0][4]));
}

TEST(ModelConfig, ImageSidesThatTheLevelsDoNotDivideAreRefusedByName) {
  ModelConfig config = TinyConfig();
  config.image_width_px = 26;
  EXPECT_THAT([&] { config.Check(); },
              ThrowsMessage<TensorError>(HasSubstr("image width is 26, wanted a multiple of 4")));
}

}  // namespace
}  // namespace evac::nn
