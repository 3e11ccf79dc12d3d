#include "worldmodel/chunk_key.h"

#include <gmock/gmock.h>

#include <fstream>
#include <functional>
#include <iterator>
#include <set>
#include <string>

#include "core/version.h"
#include "tests/worldmodel/imagined_support.h"
#include "worldmodel/nn/library.h"

namespace evac {
namespace {

/// All that a key is of: two views, three frames of which the first and the last are remembered, two to come.
struct Chunk {
  ImaginerOptions options = FewSteps();
  ImaginedScene scene;
  ChunkConditioning conditioning;

  Chunk() {
    options.identity = "weights a";
    scene.cameras = SomeCameras(2);
    scene.seed = 7;
    for (int frame = 0; frame < 3; ++frame) scene.frames.push_back({{0.25F, 0.5F, 0.75F}, ArmsAt(0.4)});
    for (std::vector<cv::Mat>* pictures : {&scene.first, &scene.newest}) {
      for (int view = 0; view < 2; ++view) pictures->emplace_back(2, 3, CV_32FC3, cv::Scalar::all(0.5));
    }
    conditioning.memory = {0, 2};
    conditioning.count = 2;
    conditioning.deltas.assign(2, DeltaRow{});
    for (int frame = 0; frame < 2; ++frame) {
      std::vector<cv::Mat>& maps = conditioning.pose_maps.emplace_back();
      for (int view = 0; view < 2; ++view) maps.emplace_back(2, 3, CV_8UC3, cv::Scalar::all(9));
    }
    const RayMap rays{.height = 1, .width = 2, .direction = std::vector<float>(6, 0.5F)};
    conditioning.rays.assign(4, std::vector<RayMap>(2, rays));
    conditioning.arms.assign(4 * 16, 0.5F);
    conditioning.turns.assign(4 * 3, 0.5F);
  }

  std::string Key() const { return ChunkKey(options, scene, conditioning); }
};

/// Of chunks that differ from one another in one thing each.
class ChunkKeyTest : public testing::Test {
 protected:
  void Differs(const std::string& what, const std::function<void(Chunk&)>& change) {
    Chunk chunk;
    change(chunk);
    EXPECT_TRUE(keys_.insert(chunk.Key()).second) << what << " is not in the key";
  }

  std::set<std::string> keys_ = {Chunk().Key()};
};

TEST_F(ChunkKeyTest, IsTheSameOfTheSameChunk) {
  EXPECT_EQ(Chunk().Key(), Chunk().Key());
  Chunk other;
  other.scene.frames[1].latent[0] += 1;
  other.options.sampler.on_step = [] {};
  other.options.cache = ChunkCacheOptions{.folder = "elsewhere"};
  EXPECT_EQ(other.Key(), Chunk().Key()) << "what is not remembered decides nothing";
  EXPECT_EQ(Chunk().Key().size(), 64u);
}

TEST_F(ChunkKeyTest, IsAnotherForEverySettingOfTheSampler) {
  Differs("solver", [](Chunk& chunk) { chunk.options.sampler.solver = nn::Solver::kDpmSolver; });
  Differs("steps", [](Chunk& chunk) { ++chunk.options.sampler.steps; });
  Differs("eta", [](Chunk& chunk) { chunk.options.sampler.eta = 0.999; });
  Differs("guidance", [](Chunk& chunk) { chunk.options.sampler.guidance = 1.001; });
  Differs("guidance_rescale", [](Chunk& chunk) { chunk.options.sampler.guidance_rescale = 0.701; });
  Differs("memory_not_scaled", [](Chunk& chunk) { chunk.options.sampler.memory_not_scaled = true; });
  Differs("residual_noise", [](Chunk& chunk) { chunk.options.sampler.residual_noise = true; });
  Differs("identity", [](Chunk& chunk) { chunk.options.identity = "weights b"; });
}

TEST_F(ChunkKeyTest, IsAnotherForEverythingOfTheScene) {
  Differs("seed", [](Chunk& chunk) { ++chunk.scene.seed; });
  Differs("number of frames", [](Chunk& chunk) { chunk.scene.frames.push_back(chunk.scene.frames[1]); });
  for (const std::size_t frame : {0, 2}) {
    for (std::size_t i = 0; i < 3; ++i)
      Differs("latent", [=](Chunk& chunk) { chunk.scene.frames[frame].latent[i] = 0.1F; });
  }
  for (std::size_t view = 0; view < 2; ++view) {
    Differs("camera", [=](Chunk& chunk) { chunk.scene.cameras[view].name += "2"; });
    Differs("first", [=](Chunk& chunk) { chunk.scene.first[view].at<cv::Vec3f>(1, 2)[2] = 0.1F; });
    Differs("newest", [=](Chunk& chunk) { chunk.scene.newest[view].at<cv::Vec3f>(1, 2)[2] = 0.1F; });
  }
}

TEST_F(ChunkKeyTest, IsAnotherForEveryNumberOfTheConditioning) {
  Differs("count", [](Chunk& chunk) { chunk.conditioning.count = 1; });
  Differs("memory", [](Chunk& chunk) { chunk.conditioning.memory = {1, 2}; });
  Differs("memory", [](Chunk& chunk) { chunk.conditioning.memory = {2, 0}; });
  for (std::size_t row = 0; row < 2; ++row) {
    for (std::size_t i = 0; i < 14; ++i)
      Differs("delta", [=](Chunk& chunk) { chunk.conditioning.deltas[row][i] = 0.1F; });
    for (std::size_t view = 0; view < 2; ++view)
      Differs("map", [=](Chunk& chunk) { chunk.conditioning.pose_maps[row][view].at<cv::Vec3b>(1, 2)[2] = 8; });
  }
  for (std::size_t i = 0; i < Chunk().conditioning.arms.size(); ++i)
    Differs("arms", [=](Chunk& chunk) { chunk.conditioning.arms[i] = 0.1F; });
  for (std::size_t i = 0; i < Chunk().conditioning.turns.size(); ++i)
    Differs("turns", [=](Chunk& chunk) { chunk.conditioning.turns[i] = 0.1F; });
  for (std::size_t frame = 0; frame < 4; ++frame) {
    for (std::size_t view = 0; view < 2; ++view) {
      const auto rays_of = [=](Chunk& chunk) -> RayMap& { return chunk.conditioning.rays[frame][view]; };
      for (std::size_t i = 0; i < 6; ++i) Differs("ray", [=](Chunk& chunk) { rays_of(chunk).direction[i] = 0.1F; });
      for (int i = 0; i < 3; ++i) Differs("origin", [=](Chunk& chunk) { rays_of(chunk).origin[i] = 0.1F; });
    }
  }
}

/// A folder that machines share, or that stayed when libtorch was renewed, gave frames of the others' rounding.
TEST_F(ChunkKeyTest, SaysWhichLibrariesAndKernelsCompute) {
  const std::string settings = ChunkSettings(Chunk().options);
  EXPECT_THAT(settings, testing::HasSubstr("evac " EVAC_VERSION));
  EXPECT_THAT(settings, testing::HasSubstr(nn::Arithmetic()));
  EXPECT_THAT(nn::Arithmetic(), testing::StartsWith("libtorch " + nn::LibtorchVersion() + " blas "));
  EXPECT_THAT(nn::Arithmetic(), testing::HasSubstr(" kernels "));
}

/// With OpenBLAS's SkylakeX and our x86-64-v4 there are three kinds of processors, and each multiplies bf16 otherwise.
TEST_F(ChunkKeyTest, SaysByWhatTheProcessorMultipliesBf16) {
  const std::string arithmetic = nn::Arithmetic();
  const std::size_t at = arithmetic.find(" bf16 ");
  ASSERT_NE(at, std::string::npos) << arithmetic;
  const std::string units = arithmetic.substr(at + 6);
  EXPECT_THAT(units, testing::AnyOf("none", "avx512bf16", "amx-bf16", "avx512bf16 amx-bf16"));
  std::ifstream cpuinfo("/proc/cpuinfo");
  const std::string said{std::istreambuf_iterator<char>(cpuinfo), {}};  // what the system lets nobody use it hides
  for (const auto& [flag, unit] : {std::pair(" avx512_bf16", "avx512bf16"), std::pair(" amx_bf16", "amx-bf16")}) {
    if (said.find(flag) == std::string::npos) continue;
    EXPECT_THAT(units, testing::HasSubstr(unit));
  }
}

}  // namespace
}  // namespace evac
