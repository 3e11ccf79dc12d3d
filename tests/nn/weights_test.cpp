#include "worldmodel/nn/weights.h"

#include <ATen/ops/equal.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <fstream>
#include <map>
#include <optional>
#include <span>

#include "tests/nn/support.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/nn/weight_keys.h"

namespace evac::nn {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

std::string BytesOf(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

template <typename Function>
std::string MessageOf(Function function) {
  try {
    function();
  } catch (const TensorError& error) {
    return error.what();
  }
  return "nothing was thrown";
}

class Weights : public ::testing::Test {
 protected:
  fs::path Saved(std::uint64_t seed = 1, const SaveOptions& options = {}) const {
    const fs::path path = folder_ / ("seed" + std::to_string(seed) + ".safetensors");
    RandomWeights weights(seed);
    SaveWeights(path, weights, config_, options);
    return path;
  }
  /// The saved file with its tensors changed.
  fs::path Changed(const std::function<void(std::vector<TensorView>&)>& change) const {
    const TensorFile file = TensorFile::Open(Saved());
    std::vector<TensorView> tensors = file.tensors();
    change(tensors);
    WriteTensorFile(folder_ / "changed.safetensors", tensors, {});
    return folder_ / "changed.safetensors";
  }
  std::string Refusal(const fs::path& path) const {
    return MessageOf([&] { LoadModel(path, config_); });
  }

  const TempFolder temp_;
  const fs::path folder_ = temp_.path();
  ModelConfig config_ = TinyConfig();
};

TensorView& Find(std::vector<TensorView>& tensors, const std::string& name) {
  for (TensorView& tensor : tensors) {
    if (tensor.name == name) return tensor;
  }
  throw TensorError("no " + name);
}

const char kOut[] = "model.diffusion_model.out.2.weight";

TEST_F(Weights, SavedLoadedAndSavedAgainAreTheSameBytes) {
  const fs::path first = Saved(), second = folder_ / "again.safetensors";
  FileWeights source(first, config_, {.with_unread = true});
  SaveWeights(second, source, config_);
  EXPECT_EQ(BytesOf(first), BytesOf(second));
}

TEST_F(Weights, LieInTheFileInThePublishedOrder) {
  const TensorFile file = TensorFile::Open(Saved());
  const std::vector<ParameterShape> keys = CheckpointKeys(config_);
  ASSERT_EQ(file.tensors().size(), keys.size());
  for (std::size_t i = 0; i < keys.size(); ++i) EXPECT_EQ(file.tensors()[i].name, keys[i].key);
}

TEST_F(Weights, OfASeedAreTheSameAlwaysAndOfAnotherAreNot) {
  const fs::path first = Saved(1);
  const std::string bytes = BytesOf(first);
  EXPECT_EQ(BytesOf(Saved(1)), bytes);
  EXPECT_NE(BytesOf(Saved(2)), bytes);
}

TEST_F(Weights, AreTheNumbersThatTheNetworkComputesWith) {
  const at::NoGradGuard no_grad;
  const fs::path path = Saved(7);
  RandomWeights drawn(7);
  const EvacModel from_file = LoadModel(path, config_), from_seed(drawn, config_);
  const Tensor latents = Noise({1, 4, 8, 12}, 3);
  EXPECT_TRUE(at::equal(from_file.vae().Decode(latents), from_seed.vae().Decode(latents)));
  const Tensor deltas = Noise({1, 3, 14}, 4);
  EXPECT_TRUE(at::equal(from_file.ActionTokens(deltas), from_seed.ActionTokens(deltas)));
}

TEST_F(Weights, InHalfTheBytesComputeNearlyTheSame) {
  const at::NoGradGuard no_grad;
  const fs::path path = Saved(7);
  const EvacModel whole = LoadModel(path, config_),
                  half = LoadModel(path, config_, {.dtype = at::kBFloat16, .products = at::kBFloat16});
  const Tensor latents = Noise({1, 4, 8, 12}, 3);
  const Tensor exact = whole.vae().Decode(latents), coarse = half.vae().Decode(latents).to(at::kFloat);
  EXPECT_FALSE(at::equal(exact, coarse));
  EXPECT_LT((exact - coarse).square().mean().item<double>(), 1e-3 * exact.square().mean().item<double>());
}

TEST_F(Weights, StayMappedAsLongAsATensorOfThemLives) {
  std::optional<FileWeights> source(std::in_place, Saved(), config_);
  const Tensor kept = source->Take(kOut, {4, 32, 3, 3});
  RandomWeights drawn(1);
  source.reset();
  EXPECT_TRUE(at::equal(kept, drawn.Take(kOut, {4, 32, 3, 3})));
  LetGo(kept);
  EXPECT_TRUE(at::equal(kept, drawn.Take(kOut, {4, 32, 3, 3})));
}

TEST_F(Weights, OfARenamedKeyAreRefusedWithBothNames) {
  const fs::path path = Changed([](auto& tensors) { Find(tensors, kOut).name = "model.diffusion_model.out.2.wait"; });
  EXPECT_THAT(Refusal(path),
              AllOf(HasSubstr("changed.safetensors"), HasSubstr("1 key is missing: " + std::string(kOut)),
                    HasSubstr("1 key is not the network's: model.diffusion_model.out.2.wait")));
}

TEST_F(Weights, OfAnotherShapeAreRefusedWithBothShapes) {
  const fs::path path = Changed([](auto& tensors) { Find(tensors, kOut).shape = {32, 4, 3, 3}; });
  EXPECT_THAT(Refusal(path), HasSubstr("1 key does not fit: " + std::string(kOut) +
                                       " is F32 [32, 4, 3, 3], wanted floats [4, 32, 3, 3]"));
}

TEST_F(Weights, OfAnotherNetworkAreRefusedWithTenNamesAndACount) {
  const fs::path path = Changed([](auto& tensors) {
    for (TensorView& tensor : tensors) tensor.name = "net." + tensor.name;
  });
  const std::string refusal = Refusal(path);
  EXPECT_THAT(refusal, HasSubstr(" keys are missing: betas, alphas_cumprod"));
  EXPECT_LT(refusal.size(), 2000u);
}

TEST_F(Weights, ThatNothingReadsMayBeAbsent) {
  const fs::path path = Changed([&](auto& tensors) {
    const std::set<std::string> dead = DeadKeys(CheckpointKeys(config_));
    EXPECT_FALSE(dead.empty());
    std::erase_if(tensors,
                  [&](const TensorView& tensor) { return dead.contains(tensor.name) || IsClipLeftover(tensor.name); });
  });
  LoadReport report;
  LoadModel(path, config_, {}, &report);
  EXPECT_TRUE(report.ignored_keys.empty());
}

TEST_F(Weights, ThatNothingReadsAreNamedWhenTheyAreThere) {
  LoadReport report;
  LoadModel(Saved(), config_, {}, &report);
  EXPECT_THAT(report.ignored_keys, ::testing::Contains("embedder.model.visual.proj"));
  EXPECT_THAT(report.ignored_keys, ::testing::Contains(HasSubstr("attn2.to_k.weight")));
  EXPECT_EQ(report.schedule, "");
}

TEST_F(Weights, DeadKeysAreThoseOfTheContextThatABlockDoesNotListenTo) {
  const std::set<std::string> dead = DeadKeys(CheckpointKeys(ModelConfig{}));
  const std::string first = "model.diffusion_model.input_blocks.1.1.transformer_blocks.0.attn2.to_",
                    second = "model.diffusion_model.input_blocks.2.1.transformer_blocks.0.attn2.to_",
                    middle = "model.diffusion_model.middle_block.1.transformer_blocks.0.attn2.to_";
  EXPECT_EQ(dead.size(), 16u * 4);
  for (const std::string& key : {first + "k_ip", second + "k_tp", middle + "v_ip", first + "k", middle + "v"})
    EXPECT_TRUE(dead.contains(key + ".weight")) << key;
  for (const std::string& key : {first + "k_tp", second + "k_ip", middle + "v_tp", first + "q"})
    EXPECT_FALSE(dead.contains(key + ".weight")) << key;
}

TEST_F(Weights, WithAScheduleThatDoesNotEndInNoiseAreReported) {
  std::vector<float> bar;
  const fs::path path = Changed([&](auto& tensors) {
    TensorView& tensor = Find(tensors, "alphas_cumprod");
    bar.resize(tensor.bytes.size() / sizeof(float));
    std::memcpy(bar.data(), tensor.bytes.data(), tensor.bytes.size());
    bar.back() = 0.0047F;
    tensor.bytes = std::as_bytes(std::span(bar));
  });
  LoadReport report;
  const EvacModel model = LoadModel(path, config_, {}, &report);
  EXPECT_THAT(report.schedule, AllOf(HasSubstr("alphas_cumprod[999] is 0.0047"), HasSubstr("configuration's is used")));
  EXPECT_EQ(model.schedule().AlphaBar(999), 0);
}

TEST_F(Weights, WithAnotherScheduleAreRefused) {
  const fs::path path = Saved();
  config_.schedule.linear_end = 0.02;
  EXPECT_THAT(Refusal(path), HasSubstr("the schedule is another than the configuration's"));
}

TEST_F(Weights, WithAnotherScaleOfLatentsAreRefusedWithTheNumberThatDiffers) {
  const fs::path path = Saved();
  config_.schedule.base_scale = 0.8;
  EXPECT_THAT(Refusal(path), HasSubstr("scale_arr[1] is 0.999248, wanted 0.999499"));
}

TEST_F(Weights, WithAnotherScaleOfLatentsAreRefusedWhereTheScheduleIsPutAsideToo) {
  std::vector<float> bar(1000, 0.0047F), scale(1400, 0.5F);
  const fs::path path = Changed([&](auto& tensors) {
    Find(tensors, "alphas_cumprod").bytes = std::as_bytes(std::span(bar));
    Find(tensors, "scale_arr").bytes = std::as_bytes(std::span(scale));
  });
  EXPECT_THAT(Refusal(path), HasSubstr("scale_arr[0] is 0.500000, wanted 1.000000"));
}

TEST_F(Weights, WithAScheduleThatWasRoundedAreTaken) {
  std::deque<Tensor> rounded;
  const fs::path path = Changed([&](auto& tensors) {
    for (const char* key : {"alphas_cumprod", "scale_arr"}) {
      TensorView& tensor = Find(tensors, key);
      rounded.push_back(TensorFrom(tensor).to(at::kBFloat16));
      tensor = ViewOf(key, rounded.back());
    }
  });
  LoadReport report;
  LoadModel(path, config_, {}, &report);
  EXPECT_EQ(report.schedule, "");
}

TEST_F(Weights, OfOtherTypesAreConverted) {
  const fs::path bf16 = Saved(1, {.dtype = at::kBFloat16});
  RandomWeights drawn(1);
  const Tensor wanted = drawn.Take(kOut, {4, 32, 3, 3});
  FileWeights as_float(bf16, config_), as_it_is(bf16, config_, {.dtype = at::kBFloat16});
  EXPECT_TRUE(at::equal(as_float.Take(kOut, wanted.sizes()), wanted.to(at::kBFloat16).to(at::kFloat)));
  EXPECT_EQ(as_it_is.Take(kOut, wanted.sizes()).scalar_type(), at::kBFloat16);
}

/// They were infinite from then on, and nobody was told.
TEST_F(Weights, BeyondAHalfsLastNumberAreNotWrittenAsHalves) {
  std::vector<float> numbers(4 * 32 * 3 * 3, 0.5F);
  numbers[7] = 1e6F;
  const fs::path large = Changed([&](std::vector<TensorView>& tensors) {
    Find(tensors, kOut).bytes = std::as_bytes(std::span(numbers));
  });
  const fs::path out = folder_ / "out.safetensors";
  for (const at::ScalarType read_as : {at::kFloat, at::kHalf}) {
    FileWeights source(large, config_, {.dtype = read_as, .with_unread = true});
    EXPECT_THAT(MessageOf([&] { SaveWeights(out, source, config_, {.dtype = at::kHalf}); }),
                HasSubstr(std::string(".safetensors: ") + kOut + " holds 1000000, which is infinite in F16"));
    EXPECT_FALSE(fs::exists(out));
  }
  FileWeights source(large, config_, {.with_unread = true});
  EXPECT_NO_THROW(SaveWeights(out, source, config_, {.dtype = at::kBFloat16}));
}

TEST_F(Weights, ForTrainingBeginAsTheRecipeSays) {
  RandomWeights weights(1, RandomWeights::LastLayers::kZero);
  RecordedWeights recorded(weights);
  const EvacModel model(recorded, config_);
  std::map<std::string, double> largest;
  for (const auto& [key, tensor] : recorded.parameters()) largest[key] = tensor.abs().max().item<double>();
  const std::string unet = "model.diffusion_model.";
  for (const char* key : {"out.2.weight", "fps_embedding.2.weight", "input_blocks.1.0.out_layers.3.weight",
                          "input_blocks.1.0.temopral_conv.conv4.3.weight", "middle_block.1.proj_out.weight",
                          "middle_block.2.proj_out.weight"})
    EXPECT_EQ(largest.at(unet + key), 0) << key;
  EXPECT_GT(largest.at(unet + "time_embed.2.weight"), 0);
  EXPECT_GT(largest.at("image_proj_model.proj_out.weight"), 0);
}

TEST_F(Weights, CutOffAnywhereEndInAMessage) {
  const std::string whole = BytesOf(Saved());
  for (const std::size_t size : {0UL, 7UL, 8UL, 100UL, whole.size() / 2, whole.size() - 1}) {
    std::ofstream(folder_ / "cut.safetensors", std::ios::binary).write(whole.data(), static_cast<long>(size));
    EXPECT_THAT(Refusal(folder_ / "cut.safetensors"), HasSubstr("cut.safetensors")) << size;
  }
}

/// They were taken without a word: what is imagined was wrong, and nothing said so.
TEST_F(Weights, SayWhichSizesTheyWereTrainedWithThatNoShapeShows) {
  config_.schedule.from_last_frame = true;
  const fs::path path = Saved(1, {.metadata = {{"sizes", SizesNobodySees(config_)}}});
  EXPECT_EQ(Refusal(path), "nothing was thrown");
  config_.schedule.from_last_frame = false;
  EXPECT_THAT(Refusal(path), AllOf(HasSubstr("seed1.safetensors: was trained with schedule.from_last_frame true"),
                                   HasSubstr("the page of sizes says false")));
  config_.schedule.from_last_frame = true;
  config_.vae.scale_factor = 1;
  EXPECT_THAT(Refusal(path), HasSubstr("vae.scale_factor 0.18215"));
  EXPECT_NO_THROW(CompareSizes(TensorFile::Open(path), config_, {"unet."})) << "the codec's own is not asked";
  config_.unet.num_head_channels = 8;
  EXPECT_THROW(CompareSizes(TensorFile::Open(path), config_, {"unet."}), TensorError);
  EXPECT_NO_THROW(CompareSizes(TensorFile::Open(Saved(2)), config_)) << "of earlier versions it is not known";
}

/// With another page it was run as another network than the one that learned, without a word.
TEST_F(Weights, SayHowManyFramesOfWhichSizeTheyWereTrainedWith) {
  config_.schedule.from_last_frame = true;
  const fs::path path = Saved(1, {.metadata = {{"sizes", SizesNobodySees(config_)}}});
  const ModelConfig page = config_;
  const auto refused = [&](const std::function<void(ModelConfig&)>& change, const char* what) {
    config_ = page;
    change(config_);
    EXPECT_THAT(Refusal(path), HasSubstr(what));
    EXPECT_NO_THROW(FileWeights(path, config_, {.is_run = false})) << "a copy";
  };
  refused([](ModelConfig& config) { config.chunk = 4; }, "was trained with chunk 3, the page of sizes says 4");
  refused([](ModelConfig& config) { config.memory = 3; }, "was trained with memory 2");
  refused([](ModelConfig& config) { config.image_height_px = 32; }, "was trained with image_height_px 16");
  refused([](ModelConfig& config) { config.image_width_px = 48; }, "was trained with image_width_px 24");
  config_ = page;
  config_.schedule.unchanged_below = 0.15;
  EXPECT_EQ(Refusal(path), "nothing was thrown") << "chosen when it is run";
}

TEST_F(Weights, SayHowManyFramesWereCarriedAndNotWhatIsChosenWhenTheyAreRun) {
  config_.views = 2;
  config_.schedule.from_last_frame = true;
  config_.schedule.carry_plane_m = 0;
  config_.schedule.carry_frames = 2;
  config_.unet.in_channels += config_.vae.z_channels + 1;
  const fs::path path = Saved(1, {.metadata = {{"sizes", SizesNobodySees(config_)}}});
  EXPECT_EQ(Refusal(path), "nothing was thrown");
  config_.schedule.carry_unless_changed = 0.4;
  EXPECT_EQ(Refusal(path), "nothing was thrown");
  config_.schedule.carry_unless_changed = 0;
  config_.schedule.carry_frames = 1;
  EXPECT_THAT(Refusal(path), HasSubstr("was trained with schedule.carry_frames 2, the page of sizes says 1"));
}

}  // namespace
}  // namespace evac::nn
