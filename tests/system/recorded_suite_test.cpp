#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "apps/evaluate.h"
#include "apps/factory.h"
#include "apps/network_parts.h"
#include "apps/recorded_suite.h"
#include "core/collection.h"
#include "core/error.h"
#include "core/file.h"
#include "core/recording_writer.h"
#include "core/store.h"
#include "core/store_lock.h"
#include "core/version.h"
#include "tests/support/command.h"
#include "tests/support/late_recording.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/weights.h"

/// A suite with a recording instead of tasks, and a network in it that was trained on others of the same robot.
namespace evac {
namespace {

namespace fs = std::filesystem;
using system_test::RunWords;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr const char* kEcho = "  - {name: echo, type: echo}\n";
constexpr const char* kEvac = "  - {name: evac, type: evac, weights: two.safetensors, config: small.yaml, steps: 1}\n";

/// A recording as AgiBot World has them: 30 Hz, three cameras, two arms. And weights of two views at 10 Hz.
class RecordedSuite : public testing::Test {
 protected:
  RecordedSuite() {
    SyntheticClip clip(25);  // every third: 9 steps, 8 targets
    clip.cameras = {"head", "hand_left", "hand_right"};
    std::ranges::fill(clip.grippers, 60.0F);
    clip.Write(OneFolder(folder_ / "pour"));
    fs::copy_file(EVAC_SOURCE_DIR "/tests/system/evac_small.yaml", folder_ / "small.yaml");
    WriteWeights("two", {{"period_s", "0.1"}, {"cameras", "head,hand_right"}, {"arms", "left,right"}});
  }

  void WriteWeights(const std::string& name, const TensorMetadata& says) const {
    nn::RandomWeights random(5);
    nn::SaveWeights(folder_ / (name + ".safetensors"), random, ReadEvacConfig(folder_ / "small.yaml"),
                    {.metadata = says});
  }

  /// @param replay  more words of the policy's command, as the YAML's list goes on
  fs::path WriteSuite(const std::string& worlds, const std::string& replay = "") const {
    const fs::path path = folder_ / "suite.yaml";
    WriteText(path, "suite: recorded\nrecording: pour\nworlds:\n" + worlds +
                        "policies:\n  - {name: replay, checkpoint: recorded, command: [evac-policy, replay, "
                        "--recording, \"${recording}\"" +
                        replay + "]}\nchunk_size: 8\nlanes: 1\nvideo: {scale: 1}\n");
    return path;
  }

  Suite Filled(const std::string& worlds, const std::vector<std::string>& assignments = {}) const {
    Suite suite = ReadSuite(WriteSuite(worlds), assignments);
    FillInRecordedTask(suite);
    return suite;
  }

  static std::vector<std::string> Cameras(const Suite& suite) {
    std::vector<std::string> names;
    for (const Camera& camera : suite.tasks.front().cameras) names.push_back(camera.name);
    return names;
  }

  const TempFolder folder_;
};

TEST_F(RecordedSuite, ItsRecordingIsSeenAsTheNetworkWasTrainedAndByAllItsWorldsAlike) {
  const Suite suite = Filled(std::string(kEcho) + kEvac);
  const Task& task = suite.tasks.front();
  EXPECT_EQ(task.period_s, 0.1);
  EXPECT_EQ(task.max_chunks, 1) << "as long as the recording: 8 steps";
  EXPECT_EQ(Cameras(suite), (std::vector<std::string>{"head", "hand_right"}));
  for (const SuiteWorld& world : suite.worlds) {
    const std::unique_ptr<World> made = MakeWorld(world, suite, nullptr);
    EXPECT_EQ(made->Reset(0, task, suite.initial_states.front(), 1).observation.images.size(), 2u) << world.name;
  }
}

TEST_F(RecordedSuite, TheDocumentedReplayTakesTheSameSteps) {
  const fs::path run = folder_ / "run";
  const CommandResult result = RunCommand(RunWords(WriteSuite(std::string(kEcho) + kEvac), run));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  Store store = Store::Open(run, Store::Mode::kReadOnly);
  ASSERT_EQ(store.Episodes().size(), 2u);
  for (Episode& episode : store.Episodes()) {
    EXPECT_EQ(episode.stop, StopReason::kRecordingEnd) << episode.failure;
    store.LoadSteps(episode);
    ASSERT_EQ(episode.commands.size(), 8u) << episode.key.world;
    EXPECT_NEAR(episode.commands[1][0].base_from_gripper.translation().x(), 0.4 + 6 * 0.01, 1e-6) << "step 6 of 30 Hz";
  }
}

TEST_F(RecordedSuite, WithoutANetworkItsRecordingIsReadWhole) {
  const Suite suite = Filled(kEcho);
  EXPECT_NEAR(suite.tasks.front().period_s, 1.0 / 30, 1e-12);
  EXPECT_EQ(suite.tasks.front().max_chunks, 3) << "24 steps";
  EXPECT_EQ(Cameras(suite), (std::vector<std::string>{"head", "hand_left", "hand_right"}));
}

TEST_F(RecordedSuite, ComesToRestByTheRuleThatThePageSaysAndByNoneOfItsOwn) {
  const auto with = [&](const std::string& line) { return Filled(std::string(kEcho) + line + "\n"); };
  EXPECT_FALSE(Filled(kEcho).tasks.front().still.enabled);
  const StillRule still = with("still: {translation_m: 0.002}").tasks.front().still;
  EXPECT_TRUE(still.enabled);
  EXPECT_EQ(still.translation_m, 0.002);
  EXPECT_EQ(still.dwell_chunks, StillRule{}.dwell_chunks);
  EXPECT_TRUE(with("still: {}").tasks.front().still.enabled) << "as docs/your_robot.md writes it";
  EXPECT_THAT([&] { with("still: {speed: 1}"); }, testing::ThrowsMessage<Error>(testing::HasSubstr("speed")));
  EXPECT_THAT([&] { with("image: {height_px: 64, width_px: 96}"); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("none beside a `recording`")));
}

/// Policies, raters and the VLM were told "Do what was recorded in 327" and no rubric, and nothing could be done about it.
TEST_F(RecordedSuite, ThePageSaysWhatIsToBeDoneAndWhatSuccessIs) {
  const auto with = [&](const std::string& lines) { return Filled(std::string(kEcho) + lines); };
  EXPECT_EQ(Filled(kEcho).tasks.front().rubric.version, kNoRubric);
  const Suite suite = with(
      "instruction: Put the cup on the shelf.\n"
      "rubric: {success: The cup stands on the shelf., stages: [{name: held, description: The hand holds the cup.}]}\n"
      "workspace_m: {min: [-1, -1, 0], max: [1, 1, 1.5]}\n");
  const Task& task = suite.tasks.front();
  EXPECT_EQ(task.instruction, "Put the cup on the shelf.");
  EXPECT_EQ(task.rubric.success, "The cup stands on the shelf.");
  ASSERT_EQ(task.rubric.stages.size(), 1u);
  EXPECT_EQ(task.rubric.stages[0].name, "held");
  EXPECT_EQ(task.workspace_m.max().z(), 1.5);
  EXPECT_NE(suite.hash, Filled(kEcho).hash);
  EXPECT_THAT([&] { with("rubric: {stages: []}\n"); }, testing::ThrowsMessage<Error>(testing::HasSubstr("success")));
  EXPECT_THAT([&] { with("instruction: ''\n"); }, testing::ThrowsMessage<Error>(testing::HasSubstr("instruction")));
}

/// It was told the sentence that is made up for people.
TEST_F(RecordedSuite, APolicyThatNeedsAnInstructionIsRefusedBeforeAnyEpisodeWhereThePageSaysNone) {
  const fs::path run = folder_ / "run";
  const std::string faulty = "{name: faulty, command: [faulty-policy, --declare, needs=instruction]}";
  const auto with = [&](std::vector<std::string> assignments) {
    assignments.push_back("policies=[{name: hold, command: [evac-policy, hold]}, " + faulty + "]");
    return RunCommand(RunWords(WriteSuite(kEcho), run, assignments));
  };
  const CommandResult refused = with({});
  EXPECT_EQ(refused.exit_code, 2) << refused.err;
  EXPECT_THAT(refused.err, AllOf(HasSubstr("suite.yaml: field instruction: found none"),
                                 HasSubstr("policy faulty@default, which declares itself as faulty@v1, needs ")));
  EXPECT_EQ(system_test::List(run), "[]\n") << "the policy before it did not run either";
  fs::remove_all(run);
  const CommandResult told = with({"instruction=Pour."});
  EXPECT_EQ(told.exit_code, 0) << told.err;
}

TEST_F(RecordedSuite, OfWeightsThatDoNotSayTheirCamerasAsManyAreSeenAsThereAreViews) {
  WriteWeights("two", {});
  EXPECT_EQ(Cameras(Filled(kEvac)), (std::vector<std::string>{"head", "hand_left"}));
}

TEST_F(RecordedSuite, TwoNetworksThatWantItOtherwiseAreRefusedWithWhatEachWants) {
  const std::string other = "  - {name: other, type: evac, weights: other.safetensors, config: small.yaml, steps: 1}\n";
  WriteWeights("other", {{"cameras", "head,hand_right"}});
  EXPECT_NO_THROW(Filled(kEvac + other));
  WriteWeights("other", {{"cameras", "head,hand_left"}});
  EXPECT_THAT([&] { Filled(kEvac + other); },
              ThrowsMessage<Error>(AllOf(HasSubstr("world evac is to see frames 0.1 s apart of head, hand_right"),
                                         HasSubstr("world other frames 0.1 s apart of head, hand_left"))));
  WriteWeights("other", {{"cameras", "head,hand_right"}});
  EXPECT_THAT([&] { Filled(kEvac + other, {"worlds.1.period_s=0.2"}); },
              ThrowsMessage<Error>(HasSubstr("world other frames 0.2 s apart")));
}

TEST_F(RecordedSuite, APeriodThatIsNoMultipleOfItsStepsIsRefused) {
  WriteWeights("two", {});
  EXPECT_THAT([&] { Filled(kEvac, {"worlds.0.period_s=0.05"}); },
              ThrowsMessage<Error>(HasSubstr("steps of 0.03333 s: wanted steps of 0.05 s, or of a whole part of it")));
}

TEST_F(RecordedSuite, WeightsOfOtherArmsAreRefusedWithBoth) {
  WriteWeights("two", {{"arms", "right"}});
  const Suite suite = Filled(kEvac);
  EXPECT_THAT([&] { CheckNetwork(suite.worlds.front(), suite.tasks); },
              ThrowsMessage<Error>(AllOf(HasSubstr("world evac: task pour: found arms left, right, wanted right"),
                                         HasSubstr("two.safetensors"))));
}

TEST_F(RecordedSuite, ATaskOfFewerCamerasThanTheNetworkHasViewsIsRefusedBeforeTheFirstEpisode) {
  WriteWeights("two", {});
  Suite suite = Filled(kEvac);
  suite.tasks.front().cameras.pop_back();
  EXPECT_THAT([&] { CheckNetwork(suite.worlds.front(), suite.tasks); },
              ThrowsMessage<Error>(HasSubstr("world evac: task pour has 1 cameras, the network imagines 2 views")));
}

TEST_F(RecordedSuite, ItsHashCoversWhatLiesElsewhereInTheTree) {
  const TreePlace place{folder_ / "tree", "carry", "1"};
  WriteLateRecording(place);
  const fs::path page = WriteSuite(kEcho);
  const auto hash = [&] { return ReadSuite(page, {"recording=" + place.Folder().string()}).hash; };
  std::set<std::string> hashes = {hash()};
  EXPECT_EQ(ReadSuite(page, {"recording=" + (place.Folder() / "videos").string()}).hash, *hashes.begin());
  fs::path last;
  for (const char* part : {"observations", "parameters", "proprio_stats"}) {
    for (const auto& entry : fs::recursive_directory_iterator(place.root / part)) {
      if (entry.is_regular_file()) last = entry.path();
    }
    WriteText(last, ReadFile(last) + " ");
    EXPECT_TRUE(hashes.insert(hash()).second) << last << " was changed and the hash is the same";
  }
}

/// A folder of recordings of one robot: each begins with its hands a centimetre further on than the one before.
class RecordedStates : public RecordedSuite {
 protected:
  RecordedStates() {
    WriteClip("many/a", 25, 0);
    WriteClip("many/b", 49, 1);
    WriteClip("many/c", 25, 2);
  }

  void WriteClip(const std::string& name, int steps, int shift_cm,
                 std::vector<std::string> cameras = {"head", "hand_left", "hand_right"}) const {
    SyntheticClip clip(steps);
    clip.cameras = std::move(cameras);
    std::ranges::fill(clip.grippers, 60.0F);
    for (std::size_t i = 0; i < clip.positions_m.size(); i += 3) clip.positions_m[i] += 0.01 * shift_cm;
    clip.Write(OneFolder(folder_ / name));
  }

  static std::vector<std::string> States(const Suite& suite) {
    std::vector<std::string> names;
    for (const InitialState& state : suite.initial_states) names.push_back(state.id);
    return names;
  }

  /// @param lines  more of the page
  Suite Many(const std::string& lines = "", const std::string& recording = "many") const {
    return Filled(std::string(kEcho) + kEvac + lines, {"recording=" + (folder_ / recording).string()});
  }
};

TEST_F(RecordedStates, OfAFolderEachIsAnInitialStateOfOneTask) {
  const Suite suite = Many();
  ASSERT_EQ(suite.tasks.size(), 1u);
  const Task& task = suite.tasks.front();
  EXPECT_EQ(task.id, "many");
  EXPECT_EQ(task.max_chunks, 2) << "the longest has 16 targets at 10 Hz";
  EXPECT_EQ(States(suite), (std::vector<std::string>{"a", "b", "c"}));
  EXPECT_NE(suite.initial_states[0].seed, suite.initial_states[1].seed);
  for (const SuiteWorld& world : suite.worlds) {
    const std::unique_ptr<World> made = MakeWorld(world, suite, nullptr);
    const auto begins_at_m = [&](const InitialState& initial) {
      return made->Reset(0, task, initial, 1).observation.arms[0].base_from_gripper.translation().x();
    };
    const double first_m = begins_at_m(suite.initial_states[0]);
    EXPECT_NEAR(begins_at_m(suite.initial_states[1]) - first_m, 0.01, 1e-6) << world.name;
    EXPECT_NEAR(begins_at_m(suite.initial_states[2]) - first_m, 0.02, 1e-6) << world.name;
  }
}

TEST_F(RecordedStates, ThePageMayTakeTheFirstAndLimitTheEpisodes) {
  const Suite suite = Many("initial_states: {count: 2}\nmax_chunks: 9\n");
  EXPECT_EQ(States(suite), (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(suite.tasks.front().max_chunks, 9);
  EXPECT_THAT([&] { Many("initial_states: {count: 4}\n"); },
              ThrowsMessage<Error>(HasSubstr("initial_states.count: found 4, wanted at most 3")));
  EXPECT_THAT([&] { Many("  - {name: other, type: echo, initial_states: 4}\n"); },
              ThrowsMessage<Error>(HasSubstr("initial_states of world other: found 4, wanted at most 3")));
  EXPECT_THAT([&] { Many("initial_states: {count: 2, seed: 1}\n"); }, ThrowsMessage<Error>(HasSubstr("seed")));
  EXPECT_THAT([&] { Many("max_chunks: 0\n"); }, ThrowsMessage<Error>(HasSubstr("max_chunks")));
  EXPECT_THAT([&] { Filled(std::string(kEcho) + "initial_states: {count: 2}\n"); },
              ThrowsMessage<Error>(HasSubstr("initial_states.count: found 2, wanted 1")));
}

/// Half a metre about where the arms stood: a task that begins with the arms at home could not reach its table.
TEST_F(RecordedStates, BeginningsShorterThanAChunkLeaveTheArmsAllOfTheTaskPagesRoom) {
  WriteClip("short/a", 7, 0);
  const Suite suite = Many("instruction: Pour.\n", "short");
  EXPECT_EQ(suite.tasks.front().workspace_m.max(), Task{}.workspace_m.max());
  EXPECT_EQ(suite.tasks.front().instruction, "Pour.");
  EXPECT_LT(Many().tasks.front().workspace_m.max().norm(), Task{}.workspace_m.max().norm()) << "where whole episodes went, and some more";
}

TEST_F(RecordedStates, ThoseThatCannotBeginAreLeftOutAndNoneIsRefused) {
  WriteClip("many/blind", 25, 0, {"head", "hand_left"});
  WriteText(folder_ / "many/broken/proprio_stats.h5", "nothing");
  EXPECT_EQ(States(Many()), (std::vector<std::string>{"a", "b", "c"})) << "neither without a camera nor broken";
  WriteText(folder_ / "none/broken/proprio_stats.h5", "nothing");
  EXPECT_THAT([&] { Many("", "none"); }, ThrowsMessage<Error>(HasSubstr("no recording can be begun from")));
  fs::create_directories(folder_ / "empty");
  EXPECT_THAT([&] { Many("", "empty"); }, ThrowsMessage<Error>(HasSubstr("no recordings; wanted")));
}

/// Policies were told where the first recording's cameras stood, and not a word of it, wherever those of a state did.
TEST_F(RecordedStates, ThoseByCamerasThatStandElsewhereThanPoliciesAreToldAreLeftOutAndCounted) {
  const auto move_head = [&](const std::string& name, double by_m) {
    WriteClip(name, 25, 0);
    const fs::path page = folder_ / name / "head_extrinsic_params_aligned.json";
    nlohmann::json poses = nlohmann::json::parse(ReadFile(page));
    for (auto& pose : poses) {
      auto& x_m = pose["extrinsic"]["translation_vector"][0];
      x_m = x_m.get<double>() + by_m;
    }
    WriteText(page, poses.dump());
  };
  const auto see_otherwise = [&](const std::string& name, const std::string& camera, const std::string& intrinsics) {
    WriteClip(name, 25, 0);
    WriteText(folder_ / name / (camera + "_intrinsic_params.json"), "{\"intrinsic\": {" + intrinsics + "}}");
  };
  move_head("many/d_nearly", 0.02);
  move_head("many/e_moved", 0.04);
  see_otherwise("many/f_zoomed", "hand_right", R"("fx": 44, "fy": 41, "ppx": 24, "ppy": 16)");
  see_otherwise("many/g_cut", "head", R"("fx": 40, "fy": 41, "ppx": 27.6, "ppy": 16)");
  WriteClip("many/h_reaches", 25, 30);  // the hand's camera is elsewhere too, and where it was on the hand
  testing::internal::CaptureStderr();
  const Suite suite = Many();
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              AllOf(HasSubstr("camera head stands 0.040 m and 0.0 degrees from where it stood in a"),
                    HasSubstr("camera hand_right has a focal length of 0.917 picture widths, in a 0.833"),
                    HasSubstr("camera head has its principal point 0.075 picture widths"),
                    HasSubstr("warning: 3 recordings of")));
  EXPECT_EQ(States(suite), (std::vector<std::string>{"a", "b", "c", "d_nearly", "h_reaches"}));
}

TEST_F(RecordedStates, OfATreeTheyAreOfOneTask) {
  for (const auto& [task, episode] : {std::pair("carry", "1"), std::pair("carry", "2"), std::pair("pour", "7")})
    WriteLateRecording({folder_ / "tree", task, episode});
  Suite suite = ReadSuite(WriteSuite(kEcho), {"recording=" + (folder_ / "tree/observations/carry").string()});
  FillInRecordedTask(suite);
  EXPECT_EQ(suite.tasks.front().id, "carry");
  EXPECT_EQ(States(suite), (std::vector<std::string>{"carry-1", "carry-2"}));
  suite = ReadSuite(WriteSuite(kEcho), {"recording=" + (folder_ / "tree").string()});
  EXPECT_THAT([&] { FillInRecordedTask(suite); },
              ThrowsMessage<Error>(HasSubstr("found tasks carry and pour")));
}

TEST_F(RecordedStates, TheHashCoversWhatLiesBesideATasksFolder) {
  for (const char* episode : {"1", "2"}) WriteLateRecording({folder_ / "tree", "carry", episode});
  const auto hash = [&] {
    return ReadSuite(WriteSuite(kEcho), {"recording=" + (folder_ / "tree/observations/carry").string()}).hash;
  };
  std::set<std::string> hashes = {hash()};
  const fs::path proprio = folder_ / "tree/proprio_stats/carry/2/proprio_stats.h5";
  WriteText(proprio, ReadFile(proprio) + " ");
  EXPECT_TRUE(hashes.insert(hash()).second);
  WriteLateRecording({folder_ / "tree", "carry", "3"});
  EXPECT_TRUE(hashes.insert(hash()).second) << "another initial state";
}

TEST_F(RecordedStates, TheHashCoversTheRowsOfACollectionsTaskWhichSayWhatItsStatesAre) {
  const auto collect = [&](const std::string& episode, const std::string& state) {
    CollectedEpisode row;
    row.task = "carry";
    row.episode = episode;
    row.initial_state = state;
    row.stop = "still";
    row.frames = 5;
    const TreePlace place{folder_ / "tree", row.task, row.episode};
    WriteLateRecording(place);
    WriteText(RowPath(place), CollectedJson(row));
  };
  const auto hash = [&] {
    return ReadSuite(WriteSuite(kEcho), {"recording=" + (folder_ / "tree/observations/carry").string()}).hash;
  };
  collect("1", "collect-7-00000");
  collect("2", "collect-7-00001");
  const std::string two_states = hash();
  collect("2", "collect-7-00000");
  EXPECT_NE(hash(), two_states) << "both began alike: there is one";
}

TEST_F(RecordedStates, TheHashOfACollectionIsTheSameWhicheverProcessWroteItLast) {
  WriteLateRecording({folder_ / "tree", "carry", "1"});
  const auto hash = [&] { return ReadSuite(WriteSuite(kEcho), {"recording=" + (folder_ / "tree").string()}).hash; };
  const std::string never_locked = hash();
  { const RunLock lock(folder_ / "tree/lock"); }
  EXPECT_EQ(hash(), never_locked);
  WriteText(folder_ / "tree/lock", "4711\n");
  EXPECT_EQ(hash(), never_locked);
}

/// Runs of the echo world whose third state cannot begin, in this process: what is there no more was there when it was read.
class LostState : public RecordedStates {
 protected:
  LostState()
      : suite_(Filled(std::string(kEcho) + "error_budget: 1\n",
                      {"recording=" + (folder_ / "many").string(), "policies.0.name=hold",
                       "policies.0.command=[evac-policy, hold]"})) {
    fs::remove_all(folder_ / "many/c");
  }

  EpisodeKey Key(const std::string& state) const {
    return {{suite_.tasks.front().id, state, "hold", "recorded", 1}, "echo"};
  }

  Store Open(const std::string& run) const {
    return Store::CreateOrContinue(
        folder_ / run, {.suite_text = suite_.text, .suite_hash = suite_.hash, .suite_path = "", .evac_version = EVAC_VERSION});
  }

  /// Runs what is to do. @returns how each state's episode stopped.
  std::map<std::string, StopReason> Stops(const std::string& run, const EvaluateOptions& options = {}) const {
    Store store = Open(run);
    EXPECT_EQ(Evaluate(suite_, store, options), ExitCode::kOk);
    std::map<std::string, StopReason> stops;
    for (const Episode& episode : store.Episodes()) stops[episode.key.pair.initial_state] = episode.stop;
    return stops;
  }

  const Suite suite_;
};

/// `--retry-failed` took its row away, and neither that call nor any after it came to an end.
TEST_F(LostState, FailsItsOwnEpisodeAndNotTheRunThatGoesOn) {
  const std::map<std::string, StopReason> wanted = {
      {"a", StopReason::kMaxChunks}, {"b", StopReason::kMaxChunks}, {"c", StopReason::kWorldError}};
  EXPECT_EQ(Stops("run"), wanted);
  EXPECT_EQ(Stops("run", {.retry_failed = true}), wanted);
  Open("run").RemoveFailed(Key("c"));
  EXPECT_EQ(Stops("run"), wanted) << "killed just before it";
}

TEST_F(LostState, FailsInAShardOfItsOwnToo) {
  Shard alone{1, 2};
  while (!alone.Holds(Key("c").pair) || alone.Holds(Key("a").pair) || alone.Holds(Key("b").pair))
    alone = alone.number < alone.of ? Shard{alone.number + 1, alone.of} : Shard{1, alone.of + 1};
  EXPECT_EQ(Stops("run", {.shard = alone}), (std::map<std::string, StopReason>{{"c", StopReason::kWorldError}}));
  const PlannedEpisodes three{suite_.tasks.front().id, "echo", "hold", "recorded", 3};
  EXPECT_EQ(Open("run").Plan(), std::vector<PlannedEpisodes>{three}) << "a shard of them is not the whole";
}

/// Reasons were gone before the world was asked whether it can begin at all.
TEST_F(LostState, LeavesFailedRowsWhereTheirWorldCannotBeTried) {
  {
    Store store = Open("run");
    Declare(suite_, store);
    store.AddPolicy({"hold", "recorded", "{}"});
    EpisodeRecord record;
    record.episode.key = Key("c");
    record.episode.stop = StopReason::kPolicyError;
    record.episode.failure = "it broke";
    store.Add(record);
  }
  fs::remove_all(folder_ / "many/a");
  EXPECT_THROW(Stops("run", {.retry_failed = true}), Error);
  EXPECT_TRUE(Open("run").Has(Key("c")));
}

TEST_F(RecordedStates, EveryPolicyBeginsInEachAndAReplayOfOneInNone) {
  const std::string recording = "recording=" + (folder_ / "many").string();
  const CommandResult refused = RunCommand(RunWords(WriteSuite(kEcho), folder_ / "replay", {recording}));
  EXPECT_EQ(refused.exit_code, 2) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("names ${recording}, but"));

  const fs::path run = folder_ / "run";
  const std::vector<std::string> assignments = {recording, "policies.0.name=hold", "policies.0.command=[evac-policy, hold]"};
  const CommandResult result = RunCommand(RunWords(WriteSuite(std::string(kEcho) + kEvac), run, assignments));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  std::map<std::string, std::set<std::string>> worlds_of;
  for (const Episode& episode : Store::Open(run, Store::Mode::kReadOnly).Episodes()) {
    EXPECT_EQ(episode.stop, StopReason::kMaxChunks) << episode.failure;
    worlds_of[episode.key.pair.initial_state].insert(episode.key.world);
  }
  EXPECT_EQ(worlds_of.size(), 3u);
  for (const auto& [state, worlds] : worlds_of) EXPECT_EQ(worlds.size(), 2u) << state;
}

TEST_F(RecordedSuite, ToldArmsAreReplayedWhereThatIsAskedForAndRecorded) {
  const TreePlace place{folder_ / "tree", "carry", "1"};
  WriteLateRecording(place);
  const std::string recording = "recording=" + place.Folder().string();
  for (const auto& [words, x_m] : {std::pair("", 0.4), std::pair(", --told", 0.41)}) {
    const fs::path run = folder_ / (*words == '\0' ? "measured" : "told");
    const CommandResult result = RunCommand(RunWords(WriteSuite(kEcho, words), run, {recording}));
    ASSERT_EQ(result.exit_code, 0) << result.err;
    Store store = Store::Open(run, Store::Mode::kReadOnly);
    Episode episode = store.Episodes().at(0);
    store.LoadSteps(episode);
    EXPECT_NEAR(episode.commands.at(0)[1].base_from_gripper.translation().x(), x_m, 1e-6) << words;
  }
  const CommandResult nothing_told =
      RunCommand({Binary("evac-policy"), "replay", "--recording", folder_ / "pour", "--told"});
  EXPECT_EQ(nothing_told.exit_code, 2) << nothing_told.err;
  EXPECT_THAT(nothing_told.err, HasSubstr("it does not say where the arms were told to be"));
}

}  // namespace
}  // namespace evac
