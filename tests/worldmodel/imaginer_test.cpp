#include "worldmodel/imaginer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/error.h"
#include "tests/worldmodel/imagined_support.h"

namespace evac {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::SizeIs;

/// One chunk through all four steps.
Pictures Imagine(const Imaginer& imaginer, ImaginedScene& scene, const std::vector<Arms>& targets) {
  const ChunkConditioning conditioning = imaginer.Condition(scene, imaginer.Remember(scene), targets);
  const ChunkLatents latents = imaginer.Denoise(scene, conditioning);
  EXPECT_EQ(WhatIsWrong(latents), std::nullopt);
  const Pictures pictures = imaginer.Decode(latents);
  imaginer.Append(scene, targets, latents, pictures);
  return pictures;
}

std::vector<float> Latents(const ImaginedScene& scene) {
  std::vector<float> all;
  for (const RememberedFrame& frame : scene.frames) all.insert(all.end(), frame.latent.begin(), frame.latent.end());
  return all;
}

double LargestDifference(const std::vector<float>& a, const std::vector<float>& b) {
  double largest = a.size() == b.size() ? 0 : std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i)
    largest = std::max<double>(largest, std::abs(a[i] - b[i]));
  return largest;
}

TEST(Imaginer, AnswersEveryTargetWithAPicturePerViewOfTheNetworksSize) {
  const Imaginer imaginer = SmallImaginer();
  ImaginedScene scene = imaginer.Begin(SomeScene(1), 7);
  EXPECT_THAT(scene.frames, SizeIs(2)) << "the memory is filled with the first frame";
  for (const std::size_t count : {3, 1, 2}) {
    const Pictures pictures = Imagine(imaginer, scene, Targets(count));
    ASSERT_THAT(pictures, SizeIs(count));
    EXPECT_THAT(pictures, Each(SizeIs(2)));
    EXPECT_EQ(pictures.front().front().size(), cv::Size(24, 16));
  }
  EXPECT_THAT(scene.frames, SizeIs(2 + 6)) << "only what was executed is remembered, not the padding of short chunks";
  EXPECT_THAT(imaginer.Remember(scene), ElementsAre(0, 7));
}

TEST(Imaginer, TheSameSeedImaginesTheSameAndAnotherSomethingElse) {
  const Imaginer imaginer = SmallImaginer();
  std::vector<std::vector<float>> latents;
  for (const std::uint64_t seed : {7, 7, 8}) {
    ImaginedScene scene = imaginer.Begin(SomeScene(1), seed);
    Imagine(imaginer, scene, Targets(3));
    Imagine(imaginer, scene, Targets(2));
    latents.push_back(Latents(scene));
  }
  EXPECT_EQ(latents[0], latents[1]);
  EXPECT_NE(latents[0], latents[2]);
}

TEST(Imaginer, ItsChunksOfNoiseDiffer) {
  const Imaginer imaginer = SmallImaginer();
  ImaginedScene scene = imaginer.Begin(SomeScene(1), 7);
  const std::vector<Arms> still(3, ArmsAt(0.4));
  Imagine(imaginer, scene, still);
  Imagine(imaginer, scene, still);
  EXPECT_NE(scene.frames[2].latent, scene.frames[5].latent);
}

TEST(Imaginer, PermutingTheViewsPermutesWhatIsImagined) {
  const Imaginer imaginer = SmallImaginer();
  InitialScene given = SomeScene(1);
  ImaginedScene scene = imaginer.Begin(given, 7);
  std::swap(given.images[0], given.images[1]);
  std::swap(given.cameras[0], given.cameras[1]);
  ImaginedScene swapped = imaginer.Begin(given, 7);
  Imagine(imaginer, scene, Targets(3));
  Imagine(imaginer, swapped, Targets(3));
  for (std::size_t f = 0; f < scene.frames.size(); ++f) {
    std::vector<float>& latent = swapped.frames[f].latent;
    std::rotate(latent.begin(), latent.begin() + static_cast<std::ptrdiff_t>(latent.size() / 2), latent.end());
  }
  EXPECT_LT(LargestDifference(Latents(scene), Latents(swapped)), 1e-4);
}

TEST(Imaginer, WhatTheArmsDoChangesWhatIsImagined) {
  const Imaginer imaginer = SmallImaginer();
  ImaginedScene one = imaginer.Begin(SomeScene(1), 7), other = imaginer.Begin(SomeScene(1), 7);
  Imagine(imaginer, one, Targets(3, 0.4));
  Imagine(imaginer, other, Targets(3, 0.3));
  EXPECT_NE(Latents(one), Latents(other));
}

TEST(Imaginer, BothSolversAndGuidanceStayFinite) {
  for (const nn::Solver solver : {nn::Solver::kDdim, nn::Solver::kDpmSolver}) {
    ImaginerOptions options = FewSteps();
    options.sampler.solver = solver;
    options.sampler.guidance = 2;
    int steps = 0;
    options.sampler.on_step = [&] { ++steps; };
    const Imaginer imaginer = SmallImaginer(1, options);
    ImaginedScene scene = imaginer.Begin(SomeScene(1, 1), 7);
    Imagine(imaginer, scene, Targets(3));
    EXPECT_EQ(steps, 2);
  }
}

TEST(Imaginer, TheImageEncoderSeesTheGivenPictureUnlessTheQuirkDecodedStart) {
  for (const bool quirk : {false, true}) {
    ImaginerOptions options = FewSteps();
    options.decoded_start = quirk;
    const Imaginer imaginer = SmallImaginer(1, options);
    ImaginedScene scene = imaginer.Begin(SomeScene(1, 1), 7);
    const cv::Mat given = scene.first.front();
    Imagine(imaginer, scene, Targets(3));
    EXPECT_EQ(cv::norm(scene.first.front(), given, cv::NORM_INF) > 0, quirk);
  }
}

TEST(Imaginer, ASceneThatDoesNotFitTheNetworkIsRefused) {
  const Imaginer imaginer = SmallImaginer();
  const auto refusal = [&](const InitialScene& scene) -> std::string {
    try {
      imaginer.Begin(scene, 7);
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal(SomeScene(1, 1)), HasSubstr("1 cameras, the network imagines 2 views"));
  InitialScene small = SomeScene(1);
  small.images[1] = Picture(40, 36, 1);
  EXPECT_THAT(refusal(small), HasSubstr("hand_right is 40x36"));
}

TEST(Imaginer, NumbersThatAreNoneAreNoticed) {
  ChunkLatents latents;
  latents.frames = {{0.0F, 1.0F}, {1.0F, 2.0F}};
  EXPECT_EQ(WhatIsWrong(latents), std::nullopt);
  latents.frames = {{0.0F, std::nanf("")}, {1.0F, std::numeric_limits<float>::infinity()}};
  EXPECT_EQ(WhatIsWrong(latents), "2 of 4 numbers of the imagined latents are not finite");
}

}  // namespace
}  // namespace evac
