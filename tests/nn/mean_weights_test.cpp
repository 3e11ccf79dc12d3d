#include "worldmodel/nn/mean_weights.h"

#include <ATen/ops/equal.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/nn/support.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/nn/weight_keys.h"

namespace evac::nn {
namespace {

namespace fs = std::filesystem;

/// Of trainings of one network: what they leave as it is, codec and forecast, is of a seed of its own.
class Trained final : public ParameterSource {
 public:
  explicit Trained(std::uint64_t seed, std::uint64_t codec = 7, std::uint64_t forecast = 7)
      : own_(seed), codec_(codec), forecast_(forecast) {}
  Tensor Take(const std::string& key, at::IntArrayRef shape) override {
    if (key.starts_with("first_stage_model")) return codec_.Take(key, shape);
    return key.starts_with(kForecastPrefix) ? forecast_.Take(key, shape) : own_.Take(key, shape);
  }

 private:
  RandomWeights own_, codec_, forecast_;
};

class MeanOfWeights : public testing::Test {
 protected:
  fs::path Written(const std::string& name, Trained weights, const SaveOptions& options) const {
    SaveWeights(folder_ / name, weights, config_, options);
    return folder_ / name;
  }
  fs::path Written(const std::string& name, std::uint64_t seed, const TensorMetadata& metadata) const {
    return Written(name, Trained(seed), {.metadata = metadata});
  }

  ModelConfig config_ = TinyConfig();
  const TempFolder temp_;
  const fs::path folder_ = temp_.path();
};

TEST_F(MeanOfWeights, IsOfEveryParameter) {
  const fs::path a = Written("a", 1, {}), b = Written("b", 2, {}), c = Written("c", 3, {});
  FileWeights first(a, config_), second(b, config_), third(c, config_);
  MeanWeights mean({a, b, c}, config_);
  int read = 0;
  for (const auto& [key, shape] : CheckpointKeys(config_)) {
    const Tensor found = mean.Take(key, shape), one = first.Take(key, shape);
    ASSERT_EQ(found.defined(), one.defined()) << key;
    if (!found.defined()) continue;
    ++read;
    EXPECT_LT(LargestDifference(found, (one + second.Take(key, shape) + third.Take(key, shape)) / 3), 1e-6) << key;
  }
  EXPECT_GT(read, 100);
}

TEST_F(MeanOfWeights, SaysWhatAllSayAndWhereEachCameFrom) {
  const fs::path a = Written("a", 1, {{"codec", "x"}, {"recipe", "r"}, {"seed", "1"}, {"holdout", ".07"}, {"other", "1"}}),
                 b = Written("b", 2, {{"codec", "x"}, {"recipe", "r"}, {"seed", "2"}, {"holdout", ".07"}, {"other", "2"}});
  const TensorMetadata expected = {{"codec", "x"}, {"recipe", "r"}, {"seed", "1 | 2"}};
  TensorMetadata found = MeanWeights({a, b}, config_).Metadata();
  found.erase("format");
  EXPECT_EQ(found, expected);
}

TEST_F(MeanOfWeights, OfDifferentCodecsIsRefused) {
  const fs::path a = Written("a", 1, {{"codec", "x"}}), b = Written("b", 2, {{"codec", "y"}}), c = Written("c", 3, {});
  EXPECT_THAT([&] { MeanWeights({a, b}, config_); }, testing::ThrowsMessage<TensorError>(testing::HasSubstr("different codecs")));
  EXPECT_THROW(MeanWeights({c, a}, config_), TensorError);
  EXPECT_THROW(MeanWeights({a}, config_), TensorError);
}

/// Where no card named a codec, or the forecasts were of two trainings, it was a mean of both and nobody's.
TEST_F(MeanOfWeights, OfAnotherCodecOrForecastThanTheOthersIsRefusedByKey) {
  config_.object_forecast = true;
  config_.unet.in_channels += 1;
  config_.vae.channel_mult = {1, 1, 1};
  const fs::path a = Written("a", Trained(1), {}), b = Written("b", Trained(2), {}),
                 codec = Written("codec", Trained(3, 8), {}),
                 forecast = Written("forecast", Trained(4, 7, 8), {});
  EXPECT_NO_THROW(MeanWeights({a, b}, config_));
  EXPECT_THAT([&] { MeanWeights({a, b, codec}, config_); },
              testing::ThrowsMessage<TensorError>(
                  testing::AllOf(testing::HasSubstr("first_stage_model."),
                                 testing::HasSubstr(codec.string() + ": wanted trainings with one codec"))));
  EXPECT_THAT([&] { MeanWeights({a, forecast}, config_); },
              testing::ThrowsMessage<TensorError>(
                  testing::AllOf(testing::HasSubstr("object_forecast."),
                                 testing::HasSubstr(forecast.string() + ": wanted trainings with one forecast"))));
}

TEST_F(MeanOfWeights, OfOneCodecThatWasRoundedForSomeIsTaken) {
  const fs::path half = Written("half", Trained(1), {.dtype = at::kBFloat16}), whole = Written("whole", Trained(2), {}),
                 other_half = Written("other_half", Trained(3), {.dtype = at::kHalf}),
                 other = Written("other", Trained(4, 8), {});
  EXPECT_NO_THROW(MeanWeights({half, whole}, config_));
  EXPECT_NO_THROW(MeanWeights({whole, half, other_half}, config_));
  EXPECT_NO_THROW(MeanWeights({half, other_half}, config_)) << "rounded differently, and of one codec";
  EXPECT_THROW(MeanWeights({half, other}, config_), TensorError);
  EXPECT_THROW(MeanWeights({other_half, other}, config_), TensorError);

  FileWeights read(half, config_, {.with_unread = true});
  SaveWeights(folder_ / "rounded", read, config_);
  EXPECT_NO_THROW(MeanWeights({half, folder_ / "rounded"}, config_));
  EXPECT_THROW(MeanWeights({half, whole, folder_ / "rounded"}, config_), TensorError) << "the two floats differ";
}

/// Each number of the codec was half way between itself and its rounding: a third codec, which no latents were made by.
TEST_F(MeanOfWeights, CodecAndForecastAreThoseOfTheFileThatSaysMostDigits) {
  config_.object_forecast = true;
  config_.unet.in_channels += 1;
  config_.vae.channel_mult = {1, 1, 1};
  const fs::path half = Written("half", Trained(1), {.dtype = at::kBFloat16}), whole = Written("whole", Trained(2), {});
  FileWeights exact(whole, config_), rounded(half, config_);
  MeanWeights mean({half, whole}, config_), of_halves({half, half}, config_);
  int differ = 0, forecast = 0;
  for (const auto& [key, shape] : CheckpointKeys(config_)) {
    if (!key.starts_with("first_stage_model") && !key.starts_with(kForecastPrefix)) continue;
    const Tensor wanted = exact.Take(key, shape);
    if (!wanted.defined()) continue;
    EXPECT_TRUE(at::equal(mean.Take(key, shape), wanted)) << key;
    EXPECT_TRUE(at::equal(of_halves.Take(key, shape), rounded.Take(key, shape))) << key;
    differ += at::equal(rounded.Take(key, shape), wanted) ? 0 : 1;
    forecast += key.starts_with(kForecastPrefix) ? 1 : 0;
  }
  EXPECT_GT(differ, 10) << "or nothing is tested";
  EXPECT_GT(forecast, 0);
}

/// The card of a mean kept no sizes where one of the cards had fewer, of an earlier version.
TEST_F(MeanOfWeights, SaysTheSizesThatItsCardsSayTogether) {
  const std::string sizes = SizesNobodySees(config_), earlier = "fps 2\ndomain 11\n";
  const fs::path a = Written("a", 1, {{"sizes", earlier}}), b = Written("b", 2, {{"sizes", sizes}}),
                 c = Written("c", 3, {}), d = Written("d", 4, {{"sizes", "chunk 5\n"}});
  EXPECT_EQ(MeanWeights({b, b}, config_).Metadata().at("sizes"), sizes);
  const fs::path both = Written("both", 5, {{"sizes", MeanWeights({a, b}, config_).Metadata().at("sizes")}});
  EXPECT_NO_THROW(FileWeights(both, config_));
  EXPECT_FALSE(MeanWeights({b, c}, config_).Metadata().contains("sizes")) << "of one it is not known";
  EXPECT_THAT([&] { MeanWeights({b, d}, config_); },
              testing::ThrowsMessage<TensorError>(testing::HasSubstr("was trained with 'chunk 3'")));
  config_.chunk = 4;
  EXPECT_THROW(FileWeights(both, config_), TensorError);
  EXPECT_NO_THROW(MeanWeights({a, b}, config_)) << "a mean is not run";
}

TEST_F(MeanOfWeights, IsForWhatThoseAreForThatSayIt) {
  const fs::path a = Written("a", 1, {{"period_s", "0.1"}}), b = Written("b", 2, {}),
                 c = Written("c", 3, {{"period_s", "0.2"}});
  EXPECT_EQ(MeanWeights({a, b}, config_).Metadata().at("period_s"), "0.1");
  EXPECT_EQ(MeanWeights({b, a}, config_).Metadata().at("period_s"), "0.1");
  EXPECT_THAT([&] { MeanWeights({a, b, c}, config_); },
              testing::ThrowsMessage<TensorError>(testing::AllOf(testing::HasSubstr("period_s is '0.1'"), testing::HasSubstr("'0.2'"))));
}

}  // namespace
}  // namespace evac::nn
