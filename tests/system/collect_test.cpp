#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <set>

#include "apps/collect_recipe.h"
#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/recording.h"
#include "core/seed.h"
#include "core/store_lock.h"
#include "core/tensor_file.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"
#include "tests/system/process_support.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using system_test::WaitUntil;
using testing::HasSubstr;
using testing::Not;

const std::string kRecipe = EVAC_SOURCE_DIR "/apps/configs/desk_recipe.yaml";
const std::string kModel = EVAC_SOURCE_DIR "/apps/configs/desk_model.yaml";

/// Three-chunk episodes: enough to look, go there and write.
std::vector<std::string> Words(const fs::path& out, const std::vector<std::string>& more = {}) {
  std::vector<std::string> words = {Binary("evac"), "collect", kRecipe, "--out",       out,
                                    "--seed",       "5",       "--set", "max_chunks=3"};
  words.insert(words.end(), more.begin(), more.end());
  return words;
}

/// The page of the desk's network with one view.
std::string OneView(const fs::path& folder) {
  std::string page = ReadFile(kModel);
  const auto replace = [&](const std::string& old, const std::string& by) {
    for (std::size_t at = page.find(old); at != std::string::npos; at = page.find(old, at + by.size()))
      page.replace(at, old.size(), by);
  };
  replace("views: 2", "views: 1");
  replace("carry_unless_changed: 0.4", "carry_unless_changed: 0");
  WriteFileAtomically(folder / "one_view.yaml", page);
  return folder / "one_view.yaml";
}

std::string HashesBelow(const fs::path& root) {
  std::set<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    if (entry.is_regular_file() && entry.path().filename() != "lock") files.insert(fs::relative(entry.path(), root));
  }
  std::string all;
  for (const fs::path& file : files) all += file.string() + " " + Sha256HexOfFile(root / file) + "\n";
  return all;
}

TEST(CollectCommand, KilledAndGoneOnWithItGivesTheSameBytesForAnyNumberOfJobs) {
  const TempFolder folder;
  ASSERT_EQ(RunCommand(Words(folder / "whole", {"--episodes", "6", "--jobs", "2"})).exit_code, 0);
  const fs::path cut = folder / "cut";
  const pid_t pid = StartCommand(Words(cut, {"--episodes", "6", "--jobs", "1"}), folder / "log");
  EXPECT_TRUE(WaitUntil([&] { return fs::exists(cut / "rows/take_toast/000001.json"); }));
  ::kill(pid, SIGKILL);
  ::waitpid(pid, nullptr, 0);
  EXPECT_FALSE(fs::exists(cut / "manifest.csv"));
  ASSERT_EQ(RunCommand(Words(cut, {"--episodes", "6", "--jobs", "1"})).exit_code, 0);
  for (const auto& entry : fs::recursive_directory_iterator(cut)) {
    if (entry.path().extension() == ".tmp") fs::remove(entry.path());  // of the file that was being written
  }
  EXPECT_EQ(HashesBelow(cut), HashesBelow(folder / "whole"));
}

TEST(CollectCommand, AFolderThatAnotherProcessWritesIsRefusedWithItsNumber) {
  const TempFolder folder;
  fs::create_directory(folder / "all");
  {
    const RunLock lock(folder / "all/lock");
    const CommandResult second = RunCommand(Words(folder / "all", {"--episodes", "1"}));
    EXPECT_EQ(second.exit_code, 2);
    EXPECT_THAT(second.err, HasSubstr("process " + std::to_string(::getpid()) + " is writing here"));
    EXPECT_FALSE(fs::exists(folder / "all/collection.json"));
  }
  ASSERT_EQ(RunCommand(Words(folder / "all", {"--episodes", "1"})).exit_code, 0);
  fs::create_directory(folder / "shards");
  const RunLock lock(folder / "shards/lock");
  const CommandResult packed = RunCommand({Binary("evac"), "pack", folder / "all", "--out", folder / "shards", "--config", kModel});
  EXPECT_EQ(packed.exit_code, 2);
  EXPECT_THAT(packed.err, HasSubstr("is writing here"));
  EXPECT_FALSE(fs::exists(folder / "shards/packing.json"));
}

TEST(CollectCommand, ACollectionIsARecordingTreeThatPacks) {
  const TempFolder folder;
  const CommandResult collected = RunCommand(Words(folder / "all", {"--episodes", "4"}));
  ASSERT_EQ(collected.exit_code, 0) << collected.err;
  EXPECT_THAT(collected.out, HasSubstr("4 episodes"));
  const Recording recording = ReadRecording(folder / "all/observations/take_ham/000002", {.read_told = true});
  EXPECT_THAT(recording.arm_names, testing::ElementsAre("right"));
  EXPECT_EQ(recording.arms.size(), 25u);
  EXPECT_EQ(recording.told.size(), 25u);
  EXPECT_EQ(recording.cameras.size(), 2u);
  const CommandResult packed = RunCommand({Binary("evac"), "pack", folder / "all", "--out", folder / "shards",
                                           "--config", kModel, "--cameras", "head,hand_right", "--holdout", "0"});
  ASSERT_EQ(packed.exit_code, 0) << packed.err;
  const TensorFile shard = TensorFile::Open(folder / "shards/shard_00000.safetensors");
  EXPECT_EQ(shard.Get("frames").shape, (std::vector<std::int64_t>{100, 2, 64, 96, 3}));
  EXPECT_EQ(shard.metadata().at("arms"), "right");
  EXPECT_EQ(shard.metadata().at("cameras"), "head,hand_right");
}

TEST(CollectCommand, WhereTheObjectIsGoesWithTheCamerasThatArePacked) {
  const TempFolder folder;
  ASSERT_EQ(RunCommand(Words(folder / "all", {"--episodes", "1"})).exit_code, 0);
  /// [T] of one view: its x and y, as bytes.
  const auto places = [&](const std::string& cameras, std::size_t view, const std::string& page = kModel) {
    const fs::path out = folder / cameras;
    const CommandResult packed = RunCommand({Binary("evac"), "pack", folder / "all", "--out", out, "--config", page,
                                             "--cameras", cameras, "--holdout", "0"});
    EXPECT_EQ(packed.exit_code, 0) << packed.err;
    const TensorFile shard = TensorFile::Open(out / "shard_00000.safetensors");
    const TensorView& all = shard.Get("object_px");
    const std::size_t row_bytes = static_cast<std::size_t>(all.shape.at(1)) * 2 * sizeof(float);
    std::string bytes;
    for (std::size_t at = view * 2 * sizeof(float); at < all.bytes.size(); at += row_bytes)
      bytes.append(reinterpret_cast<const char*>(all.bytes.data()) + at, 2 * sizeof(float));
    return bytes;
  };
  const std::string head = places("head,hand_right", 0), hand = places("head,hand_right", 1);
  EXPECT_NE(head, hand);
  EXPECT_EQ(places("hand_right,head", 0), hand);
  EXPECT_EQ(places("hand_right,head", 1), head);
  EXPECT_EQ(places("head", 0, OneView(folder.path())), head);
}

TEST(CollectCommand, ASceneThatDoesNotComeToRestIsARowAndTheOthersAreCollected) {
  const TempFolder folder;
  const fs::path scenes = EVAC_SOURCE_DIR "/worldmodel/sim/scenes";
  for (const char* file : {"take_bottle.yaml", "robot.xml"}) fs::copy(scenes / file, folder / file);
  std::string scene = ReadFile(scenes / "take_bottle.xml");
  const std::string include = R"(<include file="robot.xml"/>)";
  scene.insert(scene.find(include) + include.size(), R"(<option gravity="0 0 -1e13"/>)");
  WriteFileAtomically(folder / "take_bottle.xml", scene);
  const std::string page = "tasks.0.page=" + (folder / "take_bottle.yaml").string();
  const CommandResult collected = RunCommand(Words(folder / "all", {"--episodes", "2", "--set", page}));
  ASSERT_EQ(collected.exit_code, 0) << collected.err;
  EXPECT_THAT(collected.out, HasSubstr("2 episodes, 25 frames")) << "the other task's";
  const fs::path row_path = folder / "all/rows/take_bottle/000000.json";
  const CollectedEpisode row = ParseCollected(ReadFile(row_path), row_path);
  EXPECT_EQ(row.fate, "diverged");
  EXPECT_THAT(row.reason, HasSubstr("physics diverged before"));
}

TEST(CollectCommand, FewerEpisodesThanAreListedAreRefused) {
  const TempFolder folder;
  ASSERT_EQ(RunCommand(Words(folder / "all", {"--episodes", "2"})).exit_code, 0);
  const std::string listed = ReadFile(folder / "all/manifest.csv");
  const CommandResult fewer = RunCommand(Words(folder / "all", {"--episodes", "1"}));
  EXPECT_EQ(fewer.exit_code, 2);
  EXPECT_THAT(fewer.err, HasSubstr("manifest.jsonl lists 2 episodes, found 1 asked for, wanted no fewer"));
  EXPECT_EQ(ReadFile(folder / "all/manifest.csv"), listed);
}

TEST(CollectCommand, AnEpisodeThatDivergedIsARowWithoutARecording) {
  const TempFolder folder;
  const fs::path all = folder / "all", row_path = all / "rows/take_toast/000001.json";
  ASSERT_EQ(RunCommand(Words(all, {"--episodes", "2"})).exit_code, 0);
  CollectedEpisode row = ParseCollected(ReadFile(row_path), row_path);
  row.success = false;
  row.stop = row.fate = "diverged";
  row.frames = row.contact_frames = 0;
  WriteFileAtomically(row_path, CollectedJson(row) + "\n");
  for (const char* part : {"observations", "parameters", "proprio_stats", "truth"}) fs::remove_all(all / part / "take_toast");
  const CommandResult collected = RunCommand(Words(all, {"--episodes", "2"}));
  ASSERT_EQ(collected.exit_code, 0) << collected.err;
  EXPECT_THAT(collected.out, HasSubstr("2 episodes, 25 frames"));
  EXPECT_THAT(ReadFile(all / "manifest.csv"), HasSubstr(",0,diverged,diverged,0,0,"));
  EXPECT_EQ(ReadFile(all / "task_info/task_take_toast.json"), "[]\n");
  const CommandResult packed = RunCommand({Binary("evac"), "pack", all, "--out", folder / "shards", "--config",
                                           OneView(folder.path()), "--cameras", "head", "--holdout", "0"});
  ASSERT_EQ(packed.exit_code, 0) << packed.err;
  EXPECT_THAT(ReadFile(folder / "shards/shards.json"), testing::AllOf(HasSubstr("take_bottle/000000"), Not(HasSubstr("take_toast"))));
}

TEST(VaryCommand, DoesWhatWasToldAgainInTheSameScenes) {
  const TempFolder folder;
  ASSERT_EQ(RunCommand(Words(folder / "all", {"--episodes", "4"})).exit_code, 0);
  for (const char* shards : {"shards", "others"})
    ASSERT_EQ(RunCommand({Binary("evac"), "pack", folder / "all", "--out", folder / shards, "--config", kModel, "--cameras",
                          "head,hand_right", "--holdout", "0"}).exit_code, 0);
  const auto vary = [&](const std::string& shards, const std::string& jobs, const std::string& set) {
    return RunCommand({Binary("evac"), "vary", folder / shards, folder / "all", "--recipe", kRecipe, "--set", set, "--count",
                       "2", "--jobs", jobs});
  };
  const std::string as_collected = "max_chunks=3";
  const CommandResult varied = vary("shards", "2", as_collected);
  ASSERT_EQ(varied.exit_code, 0) << varied.err;
  ASSERT_EQ(vary("others", "1", as_collected).exit_code, 0);
  const fs::path path = folder / "shards/variants_00000.safetensors";
  EXPECT_EQ(Sha256HexOfFile(path), Sha256HexOfFile(folder / "others/variants_00000.safetensors"));
  const TensorFile variants = TensorFile::Open(path);
  const std::int64_t count = variants.Get("clip").shape[0];
  EXPECT_GE(count, 4) << "an episode without its object has none, and some leave the workspace";
  EXPECT_LE(count, 8);
  EXPECT_EQ(variants.Get("actions").shape, (std::vector<std::int64_t>{25 * count, 16}));
  EXPECT_EQ(variants.Get("object_px").shape, (std::vector<std::int64_t>{25 * count, 2, 2}));
  const auto written = fs::last_write_time(path);
  EXPECT_THAT(vary("shards", "2", as_collected).out, HasSubstr("0 new variants"));
  EXPECT_EQ(fs::last_write_time(path), written);
  fs::remove(path);
  const CommandResult refused = vary("shards", "1", "still.dwell_chunks=2");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, testing::AllOf(HasSubstr("`evac collect` had the recipe " + ReadRecipe(kRecipe, {as_collected}).hash),
                                          HasSubstr("`evac vary` has " + ReadRecipe(kRecipe, {"still.dwell_chunks=2"}).hash)));
  EXPECT_FALSE(fs::exists(path));
  const fs::path row_path = folder / "all/rows/take_bottle/000000.json";
  CollectedEpisode row = ParseCollected(ReadFile(row_path), row_path);
  ++row.world_seed;
  WriteFileAtomically(row_path, CollectedJson(row));
  const CommandResult other_row = vary("shards", "1", as_collected);
  EXPECT_EQ(other_row.exit_code, 2);
  EXPECT_THAT(other_row.err, HasSubstr(row_path.string() + ": episode 0 is"));
  EXPECT_FALSE(fs::exists(path));
  std::string shard = ReadFile(folder / "shards/shard_00000.safetensors");
  const std::string period = "\"period_s\":\"0.1\"";
  ASSERT_NE(shard.find(period), std::string::npos);
  WriteFileAtomically(folder / "shards/shard_00000.safetensors",
                      shard.replace(shard.find(period), period.size(), "\"period_s\":\"now\""));
  const CommandResult other_period = vary("shards", "1", as_collected);
  EXPECT_EQ(other_period.exit_code, 2) << other_period.err;
  EXPECT_THAT(other_period.err, HasSubstr("period_s is now, wanted 0.1"));
}

/// Nothing said which version had made half of a folder's variants.
TEST(VaryCommand, SaysThatAnotherVersionOfEvacBeganIt) {
  const TempFolder folder;
  ASSERT_EQ(RunCommand(Words(folder / "all", {"--episodes", "4"})).exit_code, 0);
  const fs::path shards = folder / "shards", begun_by = shards / "variants_begun_by";
  ASSERT_EQ(RunCommand({Binary("evac"), "pack", folder / "all", "--out", shards, "--config", OneView(folder.path()),
                        "--cameras", "head", "--holdout", "0"}).exit_code, 0);
  const auto vary = [&] {
    const CommandResult varied = RunCommand({Binary("evac"), "vary", shards, folder / "all", "--recipe", kRecipe, "--set",
                                             "max_chunks=3", "--count", "1"});
    EXPECT_EQ(varied.exit_code, 0) << varied.err;
    return varied.err;
  };
  EXPECT_THAT(vary(), Not(HasSubstr("was begun by")));
  const std::string hash = Sha256HexOfFile(shards / "variants_00000.safetensors");
  EXPECT_THAT(vary(), Not(HasSubstr("was begun by"))) << "this one did";
  WriteFileAtomically(begun_by, "0.0.1\n");
  EXPECT_THAT(vary(), HasSubstr("evac: note: what is varied in " + shards.string() + " was begun by evac 0.0.1; evac "));
  fs::remove(begun_by);
  EXPECT_THAT(vary(), HasSubstr("was begun by an evac that did not write down its version"));
  fs::remove(shards / "variants_00000.safetensors");
  EXPECT_THAT(vary(), Not(HasSubstr("was begun by"))) << "begun anew";
  EXPECT_TRUE(fs::exists(begun_by));
  EXPECT_EQ(Sha256HexOfFile(shards / "variants_00000.safetensors"), hash) << "trainings know variants by their bytes";
}

/// A mix of one checkpoint, chunks as long as its own.
std::vector<std::string> Learned(const fs::path& out, const std::string& jobs) {
  const std::string weights = EVAC_SOURCE_DIR "/worldmodel/weights/desk/policy_004000.safetensors";
  return Words(out, {"--episodes", "4", "--jobs", jobs, "--set", "chunk_size=16", "--set",
                     "mix=[{name: on_policy, share: 1, policy: learned, checkpoint: " + weights + "}]"});
}

TEST(CollectCommand, ALearnedPolicyIsRecordedWithTheSameBytesForAnyNumberOfJobs) {
  const TempFolder folder;
  const CommandResult alone = RunCommand(Learned(folder / "alone", "1"));
  ASSERT_EQ(alone.exit_code, 0) << alone.err;
  ASSERT_EQ(RunCommand(Learned(folder / "beside", "3")).exit_code, 0);
  EXPECT_EQ(HashesBelow(folder / "alone"), HashesBelow(folder / "beside"));
  EXPECT_THAT(ReadFile(folder / "alone/manifest.csv"), HasSubstr("on_policy,learned"));
  const Recording recording = ReadRecording(folder / "alone/observations/take_bottle/000000", {.read_told = true});
  ASSERT_EQ(recording.told.size(), 49u);
  const double moved_m = (recording.told.back()[0].base_from_gripper.translation() -
                          recording.told.front()[0].base_from_gripper.translation()).norm();
  EXPECT_GT(moved_m, 0.05);  // it went for the bottle
}

TEST(CollectCommand, AnUnawareHandClosesWhereTheThingWouldBe) {
  const TempFolder folder;
  const auto words = [&](const std::string& name, const std::string& how) {
    return Words(folder / name, {"--episodes", "1", "--set", "chunk_size=16", "--set",
                                 "mix=[{name: a, share: 1, policy: visual_pick" + how + "}]"});
  };
  ASSERT_EQ(RunCommand(words("there", "")).exit_code, 0);
  ASSERT_EQ(RunCommand(words("away", ", without_object: true, unaware: true")).exit_code, 0);
  const auto read = [&](const std::string& name) {
    return ReadRecording(folder / name / "observations/take_bottle/000000", {.read_told = true});
  };
  const Recording there = read("there"), away = read("away");
  ASSERT_EQ(there.told.size(), away.told.size());
  for (std::size_t row = 1; row < there.told.size(); ++row) {
    EXPECT_TRUE(there.told[row][0].base_from_gripper.isApprox(away.told[row][0].base_from_gripper, 1e-6)) << row;
    EXPECT_EQ(there.told[row][0].closure, away.told[row][0].closure) << row;
  }
  EXPECT_THAT(ReadFile(folder / "away/manifest.csv"), HasSubstr("pretended_grasp"));
}

TEST(CollectCommand, RefusesAFolderThatHoldsAnotherCollection) {
  const TempFolder folder;
  ASSERT_EQ(RunCommand(Words(folder / "a", {"--episodes", "1"})).exit_code, 0);
  const CommandResult other = RunCommand(Words(folder / "a", {"--episodes", "1", "--set", "video.crf=30"}));
  EXPECT_EQ(other.exit_code, 2);
  EXPECT_THAT(other.err, HasSubstr("holds another collection"));
}

/// After an upgrade the same command went on without a word: one collection of two versions.
TEST(CollectCommand, SaysThatAnotherVersionOfEvacBeganIt) {
  const TempFolder folder;
  const fs::path claim = folder / "a/collection.json";
  const auto collect = [&] {
    const CommandResult collected = RunCommand(Words(folder / "a", {"--episodes", "1"}));
    EXPECT_EQ(collected.exit_code, 0) << collected.err;
    return collected.err;
  };
  collect();
  EXPECT_THAT(collect(), Not(HasSubstr("was begun by")));
  nlohmann::ordered_json page = nlohmann::ordered_json::parse(ReadFile(claim));
  page["evac_version"] = "0.0.1";
  WriteFileAtomically(claim, page.dump(2) + "\n");
  EXPECT_THAT(collect(), HasSubstr("evac: note: " + (folder / "a").string() + " was begun by evac 0.0.1; evac "));
  page.erase("evac_version");
  WriteFileAtomically(claim, page.dump(2) + "\n");
  EXPECT_THAT(collect(), HasSubstr("was begun by an evac that did not write down its version"));
}

TEST(Recipe, GrowsWithoutChangingWhatIsThere) {
  const Recipe few = ReadRecipe(kRecipe, {"episodes=10"}), many = ReadRecipe(kRecipe, {"episodes=5000"});
  EXPECT_EQ(few.hash, many.hash);
  EXPECT_EQ(CollectedJson(JobAt(few, 7, 9).row), CollectedJson(JobAt(many, 7, 9).row));
  EXPECT_NE(few.hash, ReadRecipe(kRecipe, {"max_chunks=11"}).hash);
}

TEST(Recipe, EpisodesOfOneStateBeginAlikeAndGoOnDifferently) {
  const Recipe recipe = ReadRecipe(kRecipe, {});
  const CollectedEpisode a = JobAt(recipe, 7, 0).row, b = JobAt(recipe, 7, 4).row, c = JobAt(recipe, 7, 12).row;
  EXPECT_EQ(a.state_seed, b.state_seed);
  EXPECT_NE(a.policy_seed, b.policy_seed);
  EXPECT_NE(a.state_seed, c.state_seed);
}

TEST(Recipe, NoInitialStateIsOneOfASuites) {
  const Recipe recipe = ReadRecipe(kRecipe, {});
  std::set<std::uint64_t> collected;
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    for (std::int64_t index = 0; index < 400; ++index) collected.insert(JobAt(recipe, seed, index).row.state_seed);
  }
  for (std::uint64_t seed = 0; seed < 100; ++seed) {
    for (std::uint64_t state = 0; state < 100; ++state) {
      for (const CollectTask& task : recipe.tasks)  // as harness/suite.cpp and harness/scheduler.cpp seed them
        ASSERT_FALSE(collected.contains(SeedFor(SeedFor(SeedFor(seed, "initial state"), state), task.task.id)));
    }
  }
}

TEST(Recipe, AMistakeIsNamedWithItsFieldBeforeAnythingRuns) {
  const auto error_of = [](const std::string& assignment) -> std::string {
    try {
      ReadRecipe(kRecipe, {assignment});
    } catch (const Error& error) {
      return error.what();
    }
    return "it was read";
  };
  EXPECT_THAT(error_of("mix.0.noise_m=[0.1, 0]"), HasSubstr("noise_m"));
  EXPECT_THAT(error_of("mix.0.noise_m=[0, 3]"), HasSubstr("noise-m"));
  EXPECT_THAT(error_of("mix.0.sway_m=[0, 3]"), HasSubstr("sway_m"));
  EXPECT_THAT(error_of("mix=[{name: a, share: 1, policy: visual_pick, unaware: true}]"), HasSubstr("without_object"));
  EXPECT_THAT(error_of("mix.0.courage=[0, 1]"), HasSubstr("courage"));
  EXPECT_THAT(error_of("mix.0.policy=oracle"), HasSubstr("policy"));
  EXPECT_THAT(error_of("tasks.0.object=cup"), HasSubstr("cup"));
  EXPECT_THAT(error_of("mix.0.share=0"), HasSubstr("share"));
  EXPECT_THAT(error_of("mix.0.checkpoint=x.safetensors"), HasSubstr("checkpoint"));
  EXPECT_THAT(error_of("mix=[{name: a, share: 1, policy: learned}]"), HasSubstr("checkpoint"));
  const std::string weights = EVAC_SOURCE_DIR "/worldmodel/weights/desk/";
  const auto with = [&](const std::string& file) {
    return error_of("mix=[{name: a, share: 1, policy: learned, checkpoint: " + weights + file + "}]");
  };
  EXPECT_THAT(with("policy_0.safetensors"), HasSubstr("policy_0.safetensors"));
  EXPECT_THAT(with("judge.safetensors"), HasSubstr("judge.safetensors"));
}

/// Each episode reads it anew: one collection held two policies under one hash.
TEST(Recipe, ACheckpointThatIsWrittenToMeanwhileIsRefused) {
  const TempFolder folder;
  const std::string weights = EVAC_SOURCE_DIR "/worldmodel/weights/desk/";
  const fs::path latest = folder / "latest.safetensors";
  fs::copy_file(weights + "policy_000500.safetensors", latest);
  const Recipe recipe =
      ReadRecipe(kRecipe, {"mix=[{name: a, share: 1, policy: learned, checkpoint: " + latest.string() + "}]"});
  const CollectJob job = JobAt(recipe, 1, 0);
  EXPECT_NE(MakePolicy(job, recipe.chunk_size), nullptr);
  fs::copy_file(weights + "policy_001000.safetensors", latest, fs::copy_options::overwrite_existing);
  try {
    MakePolicy(job, recipe.chunk_size);
    ADD_FAILURE() << "it goes on with another policy";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_THAT(error.what(),
                testing::AllOf(HasSubstr(latest.string()), HasSubstr("found SHA-256 " + Sha256HexOfFile(latest)),
                               HasSubstr("wanted " + Sha256HexOfFile(weights + "policy_000500.safetensors"))));
  }
}

}  // namespace
}  // namespace evac
