#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "core/error.h"
#include "core/hash.h"
#include "harness/suite.h"
#include "harness/suite_hash.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::HasSubstr;

constexpr const char* kSuite = R"(
suite: imagined
recording: rec
worlds:
  - {name: evac, type: evac, weights: w.safetensors, config: c.yaml}
policies:
  - {name: replay, command: [evac-policy, replay]}
)";

class EvacSuite : public testing::Test {
 protected:
  EvacSuite() {
    std::filesystem::create_directory(folder_ / "rec");
    Write("rec/action.npy", "bytes");
    Write("w.safetensors", "weights");
    Write("c.yaml", "chunk: 4\n");
    Write("suite.yaml", kSuite);
  }
  void Write(const std::string& name, const std::string& text) const { std::ofstream(folder_ / name) << text; }
  Suite Read(const std::vector<std::string>& assignments = {}) const {
    return ReadSuite(folder_ / "suite.yaml", assignments);
  }
  std::string Complaint(const std::vector<std::string>& assignments) const {
    try {
      Read(assignments);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      return error.what();
    }
    return "no complaint";
  }
  /// A suite of the real world and a model, nine initial states of which both try four.
  void WriteBoth() const {
    const std::string source = EVAC_SOURCE_DIR "/worldmodel/sim/";
    Write("both.yaml",
          "suite: both\nworlds:\n  - {name: real, type: mujoco, role: real, initial_states: 4, profile: " + source +
              "profiles/real.yaml}\n  - {name: evac, type: evac, weights: w.safetensors, config: c.yaml, "
              "initial_states: 4}\n"
              "tasks: [" +
              source +
              "scenes/take_bottle.yaml]\npolicies: [{name: hold, command: [evac-policy, hold]}]\n"
              "initial_states: {seed: 1, count: 9}\n");
  }
  TempFolder folder_;
};

TEST_F(EvacSuite, SaysWhatTheNetworkIsAndHowItImagines) {
  const SuiteEvac evac = Read({"worlds.0.solver=dpm", "worlds.0.steps=8", "worlds.0.cfg=2",
                               "worlds.0.quirks=[decoded_start]", "worlds.0.cache={folder: /tmp/chunks, limit_gb: 3}"})
                             .worlds[0]
                             .evac.value();
  EXPECT_EQ(evac.weights, folder_ / "w.safetensors");
  EXPECT_EQ(evac.config, folder_ / "c.yaml");
  EXPECT_EQ(evac.solver, "dpm");
  EXPECT_EQ(evac.steps, 8);
  EXPECT_EQ(evac.cfg, 2);
  EXPECT_EQ(evac.cache_folder, "/tmp/chunks");
  EXPECT_EQ(evac.cache_limit_gb, 3);
  EXPECT_FALSE(evac.bf16);
  EXPECT_TRUE(Read({"worlds.0.products=bfloat16"}).worlds[0].evac->bf16);
  EXPECT_THAT(Complaint({"worlds.0.products=half"}), AllOf(HasSubstr("products"), HasSubstr("float32 or bfloat16")));
}

TEST_F(EvacSuite, ItsHashIsOfTheFilesContentAndOfAllThatDecidesAFrame) {
  const std::string hash = Read().hash;
  std::filesystem::copy(folder_ / "w.safetensors", folder_ / "same.safetensors");
  EXPECT_EQ(Read({"worlds.0.weights=" + (folder_ / "same.safetensors").string()}).hash, hash);
  EXPECT_EQ(Read({"worlds.0.cache={folder: /tmp/chunks}"}).hash, hash) << "a cache changes nothing";
  EXPECT_NE(Read({"worlds.0.steps=9"}).hash, hash);
  EXPECT_NE(Read({"worlds.0.eta=0.5"}).hash, hash);
  EXPECT_NE(Read({"worlds.0.products=bfloat16"}).hash, hash);
  Write("c.yaml", "# a comment\nchunk: 4\n");
  EXPECT_EQ(Read().hash, hash);
  Write("c.yaml", "chunk: 5\n");
  EXPECT_NE(Read().hash, hash);
  Write("c.yaml", "chunk: 4\n");
  Write("w.safetensors", "other weights");
  EXPECT_NE(Read().hash, hash);
}

TEST_F(EvacSuite, AFileThatWasWrittenToSinceIsNamedWithBothHashes) {
  const Suite suite = Read();
  const auto complaint = [&]() -> std::string {
    try {
      DemandUnchanged(*suite.worlds.at(0).evac);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      return error.what();
    }
    return "no complaint";
  };
  EXPECT_EQ(complaint(), "no complaint");
  Write("c.yaml", "chunk: 5\n");
  EXPECT_THAT(complaint(), AllOf(HasSubstr("c.yaml"), HasSubstr(suite.worlds.at(0).evac->hash)));
  Write("c.yaml", "chunk: 4\n");
  EXPECT_EQ(complaint(), "no complaint");
  const std::string before = Sha256HexOfFile(folder_ / "w.safetensors");
  Write("w.safetensors", "other weights");
  EXPECT_THAT(complaint(), AllOf(HasSubstr("w.safetensors"), HasSubstr("wanted " + before),
                                 HasSubstr("found SHA-256 " + Sha256HexOfFile(folder_ / "w.safetensors"))));
}

/// They were hashed when the suite was read and never looked at again: episodes of two weights stood under one hash.
TEST_F(EvacSuite, APolicysFilesAndARecordingThatWereWrittenToSinceAreNamedWithBothHashes) {
  std::filesystem::create_directory(folder_ / "ckpts");
  Write("ckpts/p.safetensors", "weights");
  Write("script.py", "print()");
  const std::string files = "policies.0.files=[" + (folder_ / "ckpts").string() + ", " + (folder_ / "script.py").string() + "]";
  const std::string replay = "policies.0.command=[evac-policy, replay, --recording, \"${recording}\"]";
  const Suite suite = Read({files, replay});
  EXPECT_EQ(suite.hash, Read({files, replay}).hash);
  const auto complaint = [&]() -> std::string {
    try {
      DemandUnchanged(suite, suite.policies.at(0));
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      return error.what();
    }
    return "no complaint";
  };
  EXPECT_EQ(complaint(), "no complaint");
  const auto is_named = [&](const std::string& name, const std::string& before) {
    Write(name, "of another step");
    EXPECT_THAT(complaint(), AllOf(HasSubstr((folder_ / name).string()), HasSubstr("than when the suite was read"),
                                   HasSubstr("found SHA-256 " + Sha256Hex("of another step")),
                                   HasSubstr("wanted " + Sha256Hex(before))));
    Write(name, before);
    EXPECT_EQ(complaint(), "no complaint") << "as it was, at another time";
  };
  is_named("ckpts/p.safetensors", "weights");
  is_named("script.py", "print()");
  is_named("rec/action.npy", "bytes");
  Write("ckpts/later.pyc", "what its own interpreter writes");
  EXPECT_EQ(complaint(), "no complaint") << "nothing of it was hashed";
  std::filesystem::remove(folder_ / "script.py");
  EXPECT_THAT(complaint(), HasSubstr("script.py: cannot be read"));
}

TEST_F(EvacSuite, RealityIsTheSameWhateverTheModelAndThePoliciesAndAnotherWithAnotherWorldOrState) {
  const Suite suite = Read();
  EXPECT_NE(suite.reality_hash, suite.hash);
  EXPECT_EQ(Read({"worlds.0.steps=9"}).reality_hash, suite.reality_hash);
  for (const char* change : {"chunk_size=5", "seeds=[2]"}) EXPECT_NE(Read({change}).reality_hash, suite.reality_hash) << change;
  EXPECT_EQ(Read({"policies.0.checkpoint=other"}).reality_hash, suite.reality_hash);
  Write("w.safetensors", "other weights");
  EXPECT_EQ(Read().reality_hash, suite.reality_hash);
}

TEST_F(EvacSuite, APolicyIsTheSameAsLongAsItsNameItsCommandAndItsFilesAre) {
  Write("p.safetensors", "weights");
  const std::string file = (folder_ / "p.safetensors").string(), files = "policies.0.files=[" + file + "]";
  const auto hash = [&](const std::vector<std::string>& changes) { return PolicyHash(Read(changes).policies.at(0)); };
  const std::string before = hash({files});
  EXPECT_EQ(before.size(), 64u);
  EXPECT_EQ(hash({files, "chunk_size=5"}), before) << "the suite around it is another";
  EXPECT_NE(hash({}), before);
  EXPECT_NE(hash({files, "policies.0.name=other"}), before);
  EXPECT_NE(hash({files, "policies.0.checkpoint=other"}), before);
  EXPECT_NE(hash({files, "policies.0.command=[evac-policy, sine]"}), hash({files, "policies.0.command=[evac-policy sine]"}));
  Write("p.safetensors", "other weights");
  EXPECT_NE(hash({files}), before);
}

/// Checkpoints behind a link `last` were in no hash: a run went on with others.
TEST_F(EvacSuite, FilesBehindLinksAreHashedToo) {
  namespace fs = std::filesystem;
  for (const char* step : {"step-4000", "step-6000"}) fs::create_directories(folder_ / "ckpts" / step);
  Write("ckpts/step-4000/w", "four");
  Write("ckpts/step-6000/w", "six");
  fs::create_directory(folder_ / "used");
  const auto hash = [&](const char* step) {
    fs::remove(folder_ / "used" / "last");
    fs::create_directory_symlink(folder_ / "ckpts" / step, folder_ / "used" / "last");
    return PolicyHash(Read({"policies.0.files=[" + (folder_ / "used").string() + "]"}).policies.at(0));
  };
  EXPECT_NE(hash("step-4000"), hash("step-6000"));
  fs::create_directory_symlink(folder_ / "used", folder_ / "ckpts" / "step-4000" / "back");
  EXPECT_FALSE(hash("step-4000").empty()) << "a link to a folder that it lies in";
}

TEST_F(EvacSuite, RealityIsTheSameHoweverManyStatesOfASeedAreAsked) {
  WriteBoth();
  const auto reality = [&](const char* change) { return ReadSuite(folder_ / "both.yaml", {change}).reality_hash; };
  const Suite suite = ReadSuite(folder_ / "both.yaml", {}), more = ReadSuite(folder_ / "both.yaml", {"initial_states.count=20"});
  EXPECT_EQ(more.reality_hash, suite.reality_hash);
  EXPECT_NE(more.hash, suite.hash);
  for (std::size_t i = 0; i < suite.initial_states.size(); ++i) {
    EXPECT_EQ(more.initial_states[i].id, suite.initial_states[i].id);
    EXPECT_EQ(more.initial_states[i].seed, suite.initial_states[i].seed);
  }
  EXPECT_NE(reality("initial_states.seed=2"), suite.reality_hash);
}

TEST_F(EvacSuite, ItTriesNoMoreStatesThanTheRealWorldFromWhoseFramesItStarts) {
  WriteBoth();
  const Suite suite = ReadSuite(folder_ / "both.yaml", {});
  EXPECT_EQ(StatesOf(suite, suite.worlds[1]).size(), 4u);
  try {
    ReadSuite(folder_ / "both.yaml", {"worlds.1.initial_states=5"});
    FAIL() << "no complaint";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("worlds.1.initial_states"), HasSubstr("at most the 4 of real")));
  }
}

TEST_F(EvacSuite, WhatIsWrongIsNamedWithItsField) {
  EXPECT_THAT(Complaint({"worlds.0.weight=w"}), AllOf(HasSubstr("weight"), HasSubstr("'weights'")));
  EXPECT_THAT(Complaint({"worlds.0.weights=/nowhere"}), AllOf(HasSubstr("weights"), HasSubstr("/nowhere")));
  EXPECT_THAT(Complaint({"worlds.0.solver=euler"}), AllOf(HasSubstr("solver"), HasSubstr("ddim or dpm")));
  EXPECT_THAT(Complaint({"worlds.0.steps=0"}), HasSubstr("steps"));
  EXPECT_THAT(Complaint({"worlds.0.solver=dpm", "worlds.0.steps=1"}), HasSubstr("2 … 1000"));
  EXPECT_THAT(Complaint({"worlds.0.eta=2"}), HasSubstr("eta"));
  EXPECT_THAT(Complaint({"worlds.0.period_s=0"}), HasSubstr("period_s"));
  EXPECT_THAT(Complaint({"worlds.0.quirks=[delta_window]"}), HasSubstr("actions a policy has not sent yet"));
  EXPECT_THAT(Complaint({"worlds.0.quirks=[nonsense]"}), HasSubstr("memory_not_scaled"));
  EXPECT_THAT(Complaint({"worlds.0.cache={folder: x, limit_gb: 0}"}), HasSubstr("limit_gb"));
  EXPECT_THAT(Complaint({"worlds.0.role=real"}), HasSubstr("what is imagined is no reference"));
  const std::string weights = (folder_ / "w.safetensors").string();
  EXPECT_THAT(Complaint({"worlds.0={name: evac, type: evac, weights: " + weights + "}"}), HasSubstr("config"));
  EXPECT_THAT(Complaint({"worlds.0={name: echo, type: echo, steps: 3}"}), HasSubstr("steps"));
}

/// "~" became a file of that name, and what a mapping holds was looked for beside the suite.
TEST_F(EvacSuite, PathsInWhatIsSetAreRelativeToTheWorkingDirectoryWhereverTheyStand) {
  std::filesystem::create_directory(folder_ / "here");
  Write("here/other.safetensors", "other weights");
  Write("here/statistics.yaml", "{}\n");
  const auto here = [&](const char* file) { return std::filesystem::relative(folder_ / "here" / file).string(); };
  const std::string config = (folder_ / "c.yaml").string();
  const Suite suite = Read({"worlds=[{name: evac, type: evac, weights: " + here("other.safetensors") +
                            ", config: \"" + config + "\", cache: {folder: " + here("cache") + "}}]"});
  EXPECT_EQ(suite.worlds.at(0).evac->weights, folder_ / "here/other.safetensors");
  EXPECT_EQ(suite.worlds[0].evac->config, config);
  EXPECT_EQ(suite.worlds[0].evac->cache_folder, folder_ / "here/cache");
  EXPECT_EQ(Read({"worlds.0.cache={folder: " + here("cache") + "}"}).worlds[0].evac->cache_folder,
            folder_ / "here/cache");
  EXPECT_TRUE(Read({"worlds.0.statistics=" + here("statistics.yaml")}).worlds[0].evac->statistics);
  for (const char* nothing : {"~", "null", ""})
    EXPECT_FALSE(Read({"worlds.0.statistics=" + std::string(nothing)}).worlds[0].evac->statistics) << nothing;
}

TEST_F(EvacSuite, ATaskOfAnotherPeriodIsRefusedBeforeTheRealWorldsEpisodes) {
  WriteBoth();
  try {
    ReadSuite(folder_ / "both.yaml", {"worlds.1.period_s=0.2"});
    FAIL() << "no complaint";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_THAT(error.what(), AllOf(HasSubstr("worlds.1.period_s"), HasSubstr("0.2 s apart, those of task take_bottle 0.1 s")));
  }
}

/// x264 did not start, after the policies had, and "go on with: evac resume" never helped.
TEST_F(EvacSuite, PicturesThatNoVideoCanHoldAreRefusedBeforeTheFirstEpisode) {
  WriteBoth();
  const auto scaled = [&](int scale) {
    ReadSuite(folder_ / "both.yaml", {"image={height_px: 768, width_px: 1152}", fmt::format("video={{scale: {}}}", scale)});
  };
  EXPECT_NO_THROW(scaled(7));
  EXPECT_THAT([&] { scaled(8); },
              testing::ThrowsMessage<Error>(AllOf(HasSubstr("both.yaml: field video.scale: found 8, wanted at most 7"),
                                                  HasSubstr("2304x768"), HasSubstr("at most 16384 pixels"))));
}

TEST_F(EvacSuite, WithoutARealWorldOrARecordingNothingCouldBeStartedFrom) {
  const std::string task = EVAC_SOURCE_DIR "/worldmodel/sim/scenes/take_bottle.yaml";
  Write("suite.yaml",
        "suite: imagined\nworlds:\n  - {name: evac, type: evac, weights: w.safetensors, config: c.yaml}\ntasks: [" +
            task +
            "]\npolicies:\n  - {name: hold, command: [evac-policy, hold]}\ninitial_states: {seed: 1, count: 1}\n");
  EXPECT_THAT(Complaint({}), AllOf(HasSubstr("role: real"), HasSubstr("first frames")));
}

}  // namespace
}  // namespace evac
