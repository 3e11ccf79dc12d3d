#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>

#include "core/file.h"
#include "core/tensor_file.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;
using testing::Not;

/// What the dynamic linker would load for it.
std::string LibrariesOf(const std::string& program) {
  return RunCommand({"/usr/bin/env", "LD_TRACE_LOADED_OBJECTS=1", Binary(program)}).out;
}

TEST(NetworkProgram, IsTheOnlyOneThatLoadsLibtorch) {
  for (const std::string program : {"evac", "evac-policy", "evac-draw"})
    EXPECT_THAT(LibrariesOf(program), testing::AllOf(HasSubstr("libstdc++"), Not(HasSubstr("libtorch")))) << program;
  for (const std::string program : {"evac-networks", "evac-policy-learned"})
    EXPECT_THAT(LibrariesOf(program), HasSubstr("libtorch")) << program;
}

TEST(NetworkProgram, IsTheSameProgramToItsUser) {
  using Words = std::vector<std::string>;
  for (const Words& words : {Words{"--help"},
                             {"train", "-h"},
                             {"judge", "train", "--help"},
                             {"judge", "-h"},
                             {"weights"},
                             {"--version"},
                             {"weights", "inspect", "no such file.safetensors"},
                             {"weights", "inspect", ""},
                             {"encode", "--colour", "red"},
                             {"judge", "no such run", "--judge", "classifier", "--weights", "none.safetensors"}}) {
    Words light = words, networks = words;
    light.insert(light.begin(), Binary("evac"));
    networks.insert(networks.begin(), Binary("evac-networks"));
    const CommandResult one = RunCommand(light), other = RunCommand(networks);
    EXPECT_EQ(one.exit_code, other.exit_code) << testing::PrintToString(words);
    EXPECT_EQ(one.out, other.out) << testing::PrintToString(words);
    EXPECT_EQ(one.err, other.err) << testing::PrintToString(words);
    EXPECT_FALSE(one.out.empty() && one.err.empty());
  }
}

TEST(Help, NamesTheKindsOfArmsByTheirNamesAlone) {
  EXPECT_THAT(RunCommand({Binary("evac"), "pack", "-h"}).out, HasSubstr("--arms TEXT:{auto,told,measured}"));
}

TEST(Help, SaysWhereSeveralJudgesMayBeNamed) {
  for (const std::string command : {"trust", "compare", "dashboard"})
    EXPECT_THAT(RunCommand({Binary("evac"), command, "-h"}).out, HasSubstr("oracle,classifier")) << command;
}

TEST(Help, SaysAllThatTheLastExitCodeMeans) {
  EXPECT_THAT(RunCommand({Binary("evac"), "-h"}).out,
              HasSubstr("4 internal error, error budget spent, or interrupted"));
}

/// The desk's, with a forecast.
std::string PageWithForecast() {
  std::string page = ReadFile(EVAC_SOURCE_DIR "/apps/configs/desk_model.yaml");
  if (page.find("object_forecast: true") != std::string::npos) return page;
  const std::size_t channels = page.find("in_channels: 49");
  EXPECT_NE(channels, std::string::npos);
  page.replace(channels, 15, "in_channels: 50");
  page += "object_forecast: true\n";
  return page;
}

TEST(NetworkProgram, ANewForecastTakesThePlaceOfTheOldOneAndAllElseStays) {
  const TempFolder folder;
  WriteFileAtomically(folder / "page.yaml", PageWithForecast());
  const auto run = [&](std::vector<std::string> words) {
    words.insert(words.begin(), {Binary("evac"), "weights"});
    words.insert(words.end(), {"--config", folder / "page.yaml"});
    return RunCommand(words).exit_code;
  };
  ASSERT_EQ(run({"init", folder / "world.safetensors", "--seed", "1"}), 0);
  ASSERT_EQ(run({"init", folder / "other.safetensors", "--seed", "2"}), 0);
  ASSERT_EQ(run({"convert", folder / "world.safetensors", folder / "both.safetensors", "--forecast", folder / "other.safetensors"}), 0);
  const TensorFile world = TensorFile::Open(folder / "world.safetensors"), other = TensorFile::Open(folder / "other.safetensors"),
                   both = TensorFile::Open(folder / "both.safetensors");
  const auto same = [&](const TensorFile& as, const std::string& key) { return std::ranges::equal(both.Get(key).bytes, as.Get(key).bytes); };
  for (const char* key : {"object_forecast.hand.weight", "object_forecast.finder.0.weight"}) {
    EXPECT_TRUE(same(other, key)) << key;
    EXPECT_FALSE(same(world, key)) << key;
  }
  EXPECT_TRUE(same(world, "model.diffusion_model.input_blocks.0.0.weight"));
}

/// It stood beside a forecast that it was not measured with.
TEST(NetworkProgram, WithANewForecastTheHoldoutOfTheOldOneIsNotSaid) {
  const TempFolder folder;
  WriteFileAtomically(folder / "page.yaml", PageWithForecast());
  const std::string world = folder / "world.safetensors", measured = folder / "measured.safetensors";
  const auto card = [&](std::vector<std::string> words, const std::string& out) {
    words.insert(words.begin(), {Binary("evac"), "weights"});
    words.insert(words.end(), {"--config", folder / "page.yaml"});
    const CommandResult result = RunCommand(words);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return TensorFile::Open(out).metadata();
  };
  card({"init", world}, world);
  WriteTensorFile(measured, TensorFile::Open(world).tensors(), {{"format", "pt"}, {"holdout", "0.07"}, {"steps", "9"}});
  const std::string copy = folder / "copy.safetensors", other = folder / "other.safetensors";
  EXPECT_EQ(card({"convert", measured, copy}, copy).at("holdout"), "0.07");
  const TensorMetadata found = card({"convert", measured, other, "--forecast", world}, other);
  EXPECT_FALSE(found.contains("holdout"));
  EXPECT_EQ(found.at("steps"), "9");
}

/// It was taken over, and looked for the thing where no table is.
TEST(NetworkProgram, AForecastOfAnotherPlaneIsNotTakenOver) {
  const TempFolder folder;
  WriteFileAtomically(folder / "page.yaml", PageWithForecast());
  const std::string world = folder / "world.safetensors", forecast = folder / "forecast.safetensors",
                    out = folder / "out.safetensors";
  const std::vector<std::string> page = {"--config", folder / "page.yaml"};
  const auto run = [&](std::vector<std::string> words) {
    words.insert(words.begin(), {Binary("evac"), "weights"});
    words.insert(words.end(), page.begin(), page.end());
    return RunCommand(words);
  };
  ASSERT_EQ(run({"init", world}).exit_code, 0);
  const TensorFile file = TensorFile::Open(world);
  WriteTensorFile(forecast, file.tensors(), {{"carry_plane_m", "0.4"}});
  const CommandResult refused = run({"convert", world, out, "--forecast", forecast});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr(forecast + ": the forecast was trained for carry_plane_m '0.4', wanted '0'"));
  EXPECT_FALSE(std::filesystem::exists(out));
  WriteTensorFile(forecast, file.tensors(), {{"carry_plane_m", "0"}});
  EXPECT_EQ(run({"convert", world, out, "--forecast", forecast}).exit_code, 0);
}

/// Weights of another size once made a page of keys that do not fit, and no word of the page that was wanted.
TEST(NetworkProgram, ConvertingWeightsOfAnotherSizeAsksForTheirPage) {
  const TempFolder folder;
  const std::string weights = EVAC_SOURCE_DIR "/worldmodel/weights/desk/evac.safetensors";
  const std::string out = folder / "out.safetensors";
  std::vector<std::string> words = {Binary("evac"), "weights", "convert", weights, out, "--lean", "--dtype", "bf16"};
  const CommandResult refused = RunCommand(words);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, testing::AllOf(HasSubstr(weights), HasSubstr("wanted --config PAGE")));
  EXPECT_LT(refused.err.size(), 500u);
  EXPECT_FALSE(std::filesystem::exists(out));
  words.insert(words.end(), {"--config", EVAC_SOURCE_DIR "/apps/configs/desk_model.yaml"});
  EXPECT_EQ(RunCommand(words).exit_code, 0);
  EXPECT_EQ(std::filesystem::file_size(out) / 1000, std::filesystem::file_size(weights) / 1000);
}

}  // namespace
}  // namespace evac
