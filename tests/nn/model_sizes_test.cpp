#include "worldmodel/nn/model_sizes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <set>
#include <utility>

#include "core/config.h"
#include "core/error.h"
#include "tests/nn/support.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/number_text.h"

namespace evac::nn {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr const char* kPage = EVAC_SOURCE_DIR "/apps/configs/evac_published.yaml";

std::string AllOf(ModelConfig config) {
  std::string text;
  for (const Size& size : SizesOf(config)) text += size.Key() + " " + TextOf(size) + "\n";
  return text;
}

/// Another value than it has.
struct Otherwise {
  void operator()(std::int64_t* field) const { *field += 3; }
  void operator()(std::vector<std::int64_t>* field) const { field->push_back(7); }
  void operator()(double* field) const { *field += 1.0 / 3; }
  void operator()(std::optional<double>* field) const { *field = field->value_or(0) - 0.1; }
  void operator()(bool* field) const { *field = !*field; }
};

TEST(Sizes, EveryFieldOfThePublishedPageIsOneAndHasItsDefault) {
  const Config page = Config::FromFile(kPage);
  std::set<std::string> keys;
  for (const std::string& key : page.Keys()) {
    if (key != "schedule" && key != "unet" && key != "pose_map" && key != "vae" && !key.starts_with("image_resampler") &&
        key != "action_resampler" && key != "image_encoder")
      keys.insert(key);
    else
      for (const std::string& name : page.Section(key).Keys()) keys.insert(key + "." + name);
  }
  ModelConfig config;
  std::set<std::string> ours;
  for (const Size& size : SizesOf(config)) EXPECT_TRUE(ours.insert(size.Key()).second) << size.Key() << " is there twice";
  for (const std::string& key : keys) EXPECT_TRUE(ours.contains(key)) << key;
  for (const char* commented :
       {"schedule.carry_plane_m", "schedule.carry_frames", "schedule.carry_unless_changed", "schedule.carry_first",
        "schedule.unchanged_below", "pose_map.drop_line_m", "pose_map.lag_frames"})
    EXPECT_EQ(keys.insert(commented).second, true) << commented;
  EXPECT_EQ(ours, keys);
  EXPECT_EQ(AllOf(ReadEvacConfig(kPage)), AllOf(ModelConfig()));
}

TEST(Sizes, AsTextAreTheSameWhenReadAgain) {
  ModelConfig other;
  for (const Size& size : SizesOf(other)) std::visit(Otherwise(), size.field);
  const std::string said = AllOf(other), published = AllOf({});
  EXPECT_NE(said, published);
  ModelConfig again;
  const std::vector<Size> from = SizesOf(other), to = SizesOf(again);
  for (std::size_t i = 0; i < from.size(); ++i) {
    EXPECT_NE(TextOf(from[i]), TextOf(to[i])) << from[i].Key();
    EXPECT_TRUE(SetFromText(to[i], TextOf(from[i]))) << from[i].Key();
  }
  EXPECT_EQ(AllOf(again), said);
  EXPECT_EQ(again.vae.scale_factor, other.vae.scale_factor) << "to the last digit";
}

/// The desk's network has no attention within pictures; a job that was written for it could not be read.
TEST(Sizes, AListOfNoneIsOneToo) {
  ModelConfig config;
  for (const Size& size : SizesOf(config)) {
    if (size.Key() != "unet.attention_resolutions") continue;
    EXPECT_TRUE(SetFromText(size, ""));
    EXPECT_EQ(TextOf(size), "");
  }
  EXPECT_TRUE(config.unet.attention_resolutions.empty());
}

TEST(Sizes, TextThatIsNoneLeavesThemAsTheyWere) {
  ModelConfig config;
  const std::string before = AllOf(config);
  for (const Size& size : SizesOf(config)) {
    for (const char* text : {"x", "1.5.2", "nan", "1,", "truth", "1e999", "1 "})
      EXPECT_FALSE(SetFromText(size, text)) << size.Key() << " '" << text << "'";
    if (std::holds_alternative<std::int64_t*>(size.field)) {
      EXPECT_FALSE(SetFromText(size, "99999999999999999999")) << size.Key();
    }
  }
  EXPECT_EQ(AllOf(config), before);
}

/// The stride was counted before the levels were: a shift by more than there are bits.
TEST(Sizes, APublishedPagesCodecOfNoLevelsOrTooManyIsRefusedByField) {
  const TempFolder folder;
  std::string many = "1";
  for (int i = 0; i < 70; ++i) many += ", 1";
  for (const std::string& levels : {std::string(), many}) {
    WriteText(folder / "page.yaml", "model: {params: {image_size: [40, 64], first_stage_config: {params: {ddconfig: "
                                    "{ch_mult: [" + levels + "]}}}}}\n");
    EXPECT_THAT([&] { ReadEvacConfig(folder / "page.yaml"); },
                ThrowsMessage<Error>(testing::AllOf(HasSubstr("page.yaml"), HasSubstr("ch_mult"),
                                                    HasSubstr("1 to 8 levels"))));
  }
}

/// Shards were packed and weights trained without one mark on their pose maps.
TEST(Sizes, LengthsInMillimetresAreRefusedByField) {
  ModelConfig config;
  config.schedule.from_last_frame = true;
  config.schedule.carry_plane_m = -0.75;
  config.unet.in_channels += config.vae.z_channels + 1;
  config.pose_map.drop_line_m = 1.5;
  config.pose_map.tool_length_m = 1.2;
  EXPECT_NO_THROW(config.Check());
  const auto refused = [&](double& field, double value, const std::string& what) {
    const double before = std::exchange(field, value);
    EXPECT_THAT([&] { config.Check(); }, ThrowsMessage<TensorError>(HasSubstr(what)));
    field = before;
  };
  refused(config.pose_map.tool_length_m, 230, "pose_map.tool_length_m: found 230, wanted metres, -5 … 5");
  refused(config.pose_map.tool_length_m, -230, "pose_map.tool_length_m: found -230");
  refused(*config.pose_map.drop_line_m, 700, "pose_map.drop_line_m: found 700, wanted metres, -10 … 10");
  refused(*config.schedule.carry_plane_m, 750, "schedule.carry_plane_m: found 750, wanted metres, -10 … 10");
}

/// Noise would have been taken for velocity, and every picture been noise.
TEST(Sizes, APublishedPageOfANetworkThatPredictsNoiseIsRefused) {
  const TempFolder folder;
  const auto page = [&](const std::string& parameterization) {
    WriteText(folder / "page.yaml", "model: {params: {" + parameterization + "timesteps: 1000}}\n");
    return ReadEvacConfig(folder / "page.yaml");
  };
  EXPECT_THAT([&] { page("parameterization: eps, "); },
              ThrowsMessage<Error>(testing::AllOf(HasSubstr("page.yaml"), HasSubstr("parameterization"),
                                                  HasSubstr("eps"), HasSubstr("v: "))));
  EXPECT_EQ(page("parameterization: v, ").schedule.steps, 1000);
  EXPECT_EQ(page("").schedule.steps, 1000) << "the published network is meant";
}

/// What jobs, sizes, settings and shards were each reading by code of their own.
TEST(NumberText, IsReadWholeOrLeavesWhatWasThere) {
  double number = 7;
  std::int64_t whole = 7;
  std::uint64_t natural = 7;
  bool flag = true;
  for (const char* text : {"", "x", "1x", " 1", "1 ", "+1", "nan", "inf", "1e999", "True", "yes"}) {
    EXPECT_FALSE(ParseNumber(text, number)) << text;
    EXPECT_FALSE(ParseNumber(text, whole)) << text;
    EXPECT_FALSE(ParseNumber(text, natural)) << text;
    EXPECT_FALSE(ParseFlag(text, flag)) << text;
  }
  EXPECT_FALSE(ParseNumber("0.5", whole));
  EXPECT_FALSE(ParseNumber("9223372036854775808", whole));
  EXPECT_FALSE(ParseNumber("-1", natural));
  EXPECT_FALSE(ParseFlag("1", flag));
  EXPECT_EQ(number, 7);
  EXPECT_EQ(whole, 7);
  EXPECT_EQ(natural, 7U);
  EXPECT_TRUE(flag);

  EXPECT_TRUE(ParseNumber("-9223372036854775808", whole));
  EXPECT_EQ(whole, std::numeric_limits<std::int64_t>::min());
  EXPECT_TRUE(ParseNumber("18446744073709551615", natural));
  EXPECT_EQ(natural, std::numeric_limits<std::uint64_t>::max());
  EXPECT_TRUE(ParseFlag("false", flag));
  EXPECT_FALSE(flag);
  for (const double exact : {1.0 / 3, -0.1, 1e-300, 5e300, 0.0}) {
    EXPECT_TRUE(ParseNumber(TextOfNumber(exact), number)) << exact;
    EXPECT_EQ(number, exact);
  }
}

/// "clip.image" and "action resampler" are no fields of a page.
TEST(Sizes, AreRefusedByTheNamesThatThePageHasForThem) {
  const auto refused = [](auto change, const std::string& why) {
    ModelConfig config = TinyConfig();
    change(config);
    EXPECT_THAT([&] { config.Check(); }, ThrowsMessage<TensorError>(HasSubstr(why)));
  };
  refused([](ModelConfig& config) { config.image_encoder.image_px = config.image_encoder.patch_px + 1; },
          "wanted a multiple of image_encoder.patch_px = ");
  refused([](ModelConfig& config) { config.image_encoder.layers = 0; }, "image_encoder.layers is 0, wanted a number");
  refused([](ModelConfig& config) { config.action_resampler.queries = 0; }, "action_resampler.queries is 0, wanted a number");
  refused([](ModelConfig& config) { config.image_resampler.ff_mult = -1; }, "image_resampler.ff_mult is -1, wanted");
  refused([](ModelConfig& config) { config.action_resampler.embedding_dim = 15; }, "action_resampler.embedding_dim is 15");
}

TEST(Sizes, ByWhichOthersAreDividedAreAskedFor) {
  const auto complaint = [](auto change) {
    return [change] {
      ModelConfig config = TinyConfig();
      change(config);
      config.Check();
    };
  };
  EXPECT_NO_THROW(complaint([](ModelConfig&) {})());
  for (const double none : {0.0, -0.18215})
    EXPECT_THAT(complaint([none](ModelConfig& config) { config.vae.scale_factor = none; }),
                ThrowsMessage<TensorError>(HasSubstr("vae.scale_factor: found ")));
  EXPECT_THAT(complaint([](ModelConfig& config) { config.schedule.linear_end = 1.2; }),
              ThrowsMessage<TensorError>(HasSubstr("schedule.linear_end: found 1.2, wanted between 0 and 1")));
  EXPECT_THAT(complaint([](ModelConfig& config) { config.schedule.linear_start = 0; }),
              ThrowsMessage<TensorError>(HasSubstr("schedule.linear_start: found 0")));
  EXPECT_THAT(complaint([](ModelConfig& config) { config.schedule.base_scale = 0; }),
              ThrowsMessage<TensorError>(HasSubstr("schedule.base_scale: found 0")));
  EXPECT_THAT(complaint([](ModelConfig& config) { config.schedule.turning_step = 1 << 29; }),
              ThrowsMessage<TensorError>(HasSubstr("schedule.turning_step is 536870912")));
}

TEST(Sizes, OfALatentThatHasNoCornersAreRefusedWhereRaysAreRead) {
  ModelConfig config = TinyConfig();
  config.unet.channel_mult = {1};
  config.unet.attention_resolutions = {1};
  config.image_height_px = config.vae.Stride();
  EXPECT_NO_THROW(config.Check());
  config.unet.hand_views = config.views;
  EXPECT_THAT([&] { config.Check(); }, ThrowsMessage<TensorError>(HasSubstr("image_height_px and image_width_px: found")));
}

}  // namespace
}  // namespace evac::nn
