#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <sstream>
#include <thread>

#include "core/collection.h"
#include "core/file.h"
#include "core/store.h"
#include "harness/suite.h"
#include "tests/support/command.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "tests/system/killed_run.h"
#include "tests/system/process_support.h"
#include "tests/system/run_support.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/weights.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

const std::string kSuite = EVAC_SOURCE_DIR "/tests/system/fidelity.yaml";

/// A world model of random weights, asked how true it is.
class FidelityRun : public testing::Test {
 protected:
  FidelityRun() {
    nn::RandomWeights random(5);
    nn::SaveWeights(weights_, random, ReadEvacConfig(EVAC_SOURCE_DIR "/tests/system/evac_small.yaml"));
  }

  /// @param parts  those that are asked for; empty: all
  std::vector<std::string> Words(const fs::path& out, const std::string& parts = "") const {
    std::vector<std::string> words = {Binary("evac"), "fidelity", kSuite, "--out", out.string(), "--set",
                                      "worlds.2.weights=" + weights_.string()};
    const auto asks = [&](const char* part) { return parts.empty() || parts.find(part) != std::string::npos; };
    if (!parts.empty()) words.insert(words.end(), {"--parts", parts});
    if (asks("counterfactual")) words.insert(words.end(), {"--counterfactual-states", "1"});
    if (asks("horizon")) words.insert(words.end(), {"--horizon-states", "1", "--horizon-chunks", "3"});
    return words;
  }

  /// The same suite with a second policy, which misses.
  std::string SuiteOfTwoPolicies() const {
    std::string text = ReadFile(kSuite);
    const auto replace = [&](const std::string& from, const std::string& to) {
      for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) text.replace(at, from.size(), to);
    };
    replace("../../", EVAC_SOURCE_DIR "/");
    replace("evac_small.yaml", EVAC_SOURCE_DIR "/tests/system/evac_small.yaml");
    replace("policies:\n", "policies:\n  - {name: visual_pick, checkpoint: poor, command: [evac-policy, visual_pick, --noise-m, \"0.08\", --retries, \"0\"]}\n");
    WriteFileAtomically(folder_ / "two.yaml", text);
    return (folder_ / "two.yaml").string();
  }

  const TempFolder folder_;
  const fs::path weights_ = folder_ / "small.safetensors";
};

/// What was measured, but for how long it took.
nlohmann::json Numbers(const fs::path& out) {
  nlohmann::json json = nlohmann::json::parse(ReadFile(out / "fidelity.json"));
  json.erase("seconds_per_chunk");
  return json;
}

void PretendItWasAboutAnotherModel(const fs::path& out) {
  std::string subject = ReadFile(out / "reality.sha256");
  subject.replace(subject.find("  model\n") - 64, 64, std::string(64, '0'));
  WriteFileAtomically(out / "reality.sha256", subject);
}

/// Where the bottle was in reality before anything was done, in a part's one episode.
Eigen::Vector3d FirstPlaceOfTheBottleIn(const fs::path& part) {
  const Store store = Store::Open(part, Store::Mode::kReadOnly);
  for (const Episode& episode : store.Episodes()) {
    const PrivilegedTrack track = store.LoadPrivileged(episode.key.Id());
    if (track.empty()) continue;
    for (const PrivilegedFrame::Body& body : track.front().bodies) {
      if (body.name == "bottle") return body.base_from_body.translation();
    }
  }
  return Eigen::Vector3d::Constant(std::nan(""));
}

/// How many chunks and how many actions of them were executed in that world, in a part's one episode.
std::pair<int, std::size_t> LengthIn(const fs::path& part, const std::string& world) {
  const Store store = Store::Open(part, Store::Mode::kReadOnly);
  for (Episode& episode : store.Episodes()) {
    if (episode.key.world != world) continue;
    store.LoadSteps(episode);
    return {episode.chunks, episode.commands.size()};
  }
  return {0, 0};
}

/// Where the arms were measured to be before anything was done, in an episode of that world.
Arms FirstArmsIn(const fs::path& out, const std::string& world) {
  const Store store = Store::Open(out / "closed", Store::Mode::kReadOnly);
  for (Episode& episode : store.Episodes()) {
    if (episode.key.world != world) continue;
    store.LoadSteps(episode);
    return episode.observations.at(0).arms;
  }
  return {};
}

int HowOften(const std::string& words, const std::string& text) {
  int count = 0;
  for (std::size_t at = 0; (at = text.find(words, at)) != std::string::npos; at += words.size()) ++count;
  return count;
}

TEST_F(FidelityRun, AsksEveryPartAndEndsInTheSameNumbersWhenItWasKilled) {
  const fs::path whole = folder_ / "whole", killed = folder_ / "killed";
  const CommandResult straight = RunCommand(Words(whole));
  ASSERT_EQ(straight.exit_code, 0) << straight.err;
  EXPECT_THAT(straight.err, HasSubstr("nobody judges the imagined clips"));
  EXPECT_EQ(HowOften("says the statistics of the arms' motion", straight.err), 1) << "it was said once for each part";

  std::istringstream rows(ReadFile(whole / "episodes.csv"));
  std::vector<std::string> lines;
  for (std::string line; std::getline(rows, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 7u) << "a head, closed loop, open loop, executed, three counterfactuals";
  EXPECT_EQ(lines[1], "closed_loop,take_bottle,visual_pick,good,3-0000,1,1,1,");
  EXPECT_EQ(lines[2], "open_loop,take_bottle,visual_pick,good,3-0000,1,1,,");
  EXPECT_THAT(lines[3], testing::StartsWith("executed,take_bottle,visual_pick,good,3-0000,1,")) << "what it chose in the model was done in reality";
  for (std::size_t i = 4; i < 7; ++i) EXPECT_THAT(lines[i], HasSubstr(",3-0000,1,0,,")) << "it fails in truth";

  const Arms real = FirstArmsIn(whole, "real"), again_measured = FirstArmsIn(whole, "again");
  ASSERT_FALSE(real.empty());
  EXPECT_NE(real[0].base_from_gripper.translation(), again_measured.at(0).base_from_gripper.translation()) << "other noise than the real world's";
  const nlohmann::json numbers = Numbers(whole);
  const auto [chunks, actions] = LengthIn(whole / "closed", "real");
  ASSERT_GT(chunks, 2);
  EXPECT_EQ(LengthIn(whole / "open", "evac"), std::pair(chunks, actions)) << "a clip is as long as the one it is held against";
  EXPECT_EQ(numbers["open_loop"]["psnr_by_chunk"].size(), actions / 8) << "the network's chunks are of 8";
  EXPECT_EQ(LengthIn(whole / "executed", "again").second, LengthIn(whole / "closed", "evac").second);
  for (const char* world : {"real", "evac"}) {
    EXPECT_EQ(LengthIn(whole / "counterfactual_never_closes", world), std::pair(chunks, actions)) << world;
  }
  EXPECT_EQ(numbers["horizon"]["psnr_moving_by_chunk"].size(), 3u);
  EXPECT_TRUE(fs::exists(whole / "index.html"));

  system_test::KillOnce([&] { return system_test::Stored(killed / "open") > 0; }, Words(killed), folder_ / "log");
  const auto finished = system_test::VideoTimes(killed / "closed");
  EXPECT_EQ(finished.size(), system_test::VideoTimes(whole / "closed").size());
  EXPECT_FALSE(fs::exists(killed / "episodes.csv")) << "it had ended before it was killed";
  const CommandResult last = RunCommand(Words(killed));
  ASSERT_EQ(last.exit_code, 0) << last.err;
  EXPECT_EQ(Numbers(killed), numbers);
  EXPECT_TRUE(system_test::MadeAnew(finished, killed / "closed").empty()) << "what was stored is kept";
  EXPECT_EQ(ReadFile(killed / "episodes.csv"), ReadFile(whole / "episodes.csv"));

  // Asked about the same reality again, it does not wait for that again, imagines anew, and ends in the same numbers.
  const fs::path again = folder_ / "again";
  PretendItWasAboutAnotherModel(whole);
  std::vector<std::string> words = Words(again);
  words.insert(words.end(), {"--reality", whole.string()});
  const CommandResult taken = RunCommand(words);
  ASSERT_EQ(taken.exit_code, 0) << taken.err;
  for (const std::string part : {"/closed: 2 ", "/counterfactual_shifted: 1 ", "/horizon: 1 "})
    EXPECT_THAT(taken.err, HasSubstr(part + "episodes taken over"));
  EXPECT_EQ(Numbers(again), numbers);
  EXPECT_EQ(ReadFile(again / "episodes.csv"), ReadFile(whole / "episodes.csv"));

  // Longer rollouts are other ones, and said to be before anything runs.
  words = Words(whole);
  words.back() = "4";
  const CommandResult longer = RunCommand(words);
  EXPECT_EQ(longer.exit_code, 2) << longer.err;
  EXPECT_THAT(longer.err, HasSubstr("horizon: --horizon-chunks: found 3 (24 frames), wanted 4 (32 frames)"));
}

/// They began from the suite's state, not from what that state is on the task: actions of one scene were done in another.
TEST_F(FidelityRun, ReplaysInRealityStartFromTheSceneThatTheirActionsAreOf) {
  const fs::path out = folder_ / "out";
  std::vector<std::string> words = Words(out, "executed,counterfactual,horizon");
  const CommandResult result = RunCommand(words);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const Eigen::Vector3d bottle = FirstPlaceOfTheBottleIn(out / "closed");
  for (const char* part : {"executed", "counterfactual_shifted", "counterfactual_never_closes", "horizon"})
    EXPECT_TRUE(FirstPlaceOfTheBottleIn(out / part).isApprox(bottle, 1e-6)) << part;

  // Replays that began elsewhere, as those of an earlier evac did, are not taken over; their scene is told by their suite's hash.
  fs::remove_all(out / "counterfactual_shifted");
  fs::copy(out / "closed", out / "counterfactual_shifted", fs::copy_options::recursive);
  words = Words(folder_ / "later", "counterfactual");
  words.insert(words.end(), {"--reality", out.string()});
  const CommandResult later = RunCommand(words);
  ASSERT_EQ(later.exit_code, 0) << later.err;
  EXPECT_THAT(later.err, HasSubstr("counterfactual_shifted: its replays began in other scenes than their actions are of"));
  EXPECT_THAT(later.err, HasSubstr("/counterfactual_never_closes: 2 episodes taken over")) << "in reality and in the model, which is the same";
  EXPECT_TRUE(FirstPlaceOfTheBottleIn(folder_ / "later" / "counterfactual_shifted").isApprox(bottle, 1e-6));
}

TEST_F(FidelityRun, InterruptedItSaysThatTheSameCommandGoesOn) {
  const fs::path out = folder_ / "out", log = folder_ / "log";
  const pid_t pid = StartCommand(Words(out), log);
  ASSERT_TRUE(system_test::WaitUntil([&] { return fs::exists(out / "closed" / "evac.sqlite"); })) << ReadFile(log);
  ::kill(pid, SIGINT);
  int status = 0;
  ASSERT_EQ(::waitpid(pid, &status, 0), pid);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 4) << status;
  EXPECT_THAT(ReadFile(log), HasSubstr("evac: interrupted\n      go on with: the same evac fidelity command\n"));
}

TEST_F(FidelityRun, AClassifierJudgesTheClipsAndSaysHowFarItIs) {
  std::vector<std::string> words = Words(folder_ / "out", "closed");
  words.insert(words.end(), {"--classifier", EVAC_SOURCE_DIR "/worldmodel/weights/desk/judge.safetensors",
                             "--set", "judges=[]"});
  const CommandResult result = RunCommand(words);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("3 of 3 episodes judged by oracle")) << "whatever judges the suite asks for";
  EXPECT_THAT(result.err, HasSubstr("3 of 3 episodes judged by classifier:")) << "real, unfilmed (left out), imagined";
  EXPECT_THAT(result.err, testing::ContainsRegex("1 of 1 episodes judged by classifier:[0-9a-f]*:masked"));
  const nlohmann::json numbers = Numbers(folder_ / "out");
  std::istringstream rows(ReadFile(folder_ / "out" / "episodes.csv"));
  std::string head, row;
  std::getline(rows, head) && std::getline(rows, row);
  EXPECT_THAT(row, testing::StartsWith("closed_loop,take_bottle,visual_pick,good,3-0000,1,1,1,"));
  EXPECT_FALSE(fs::exists(folder_ / "out" / "masked")) << "painted clips are not kept";
  MakeFolders(folder_ / "out" / "masked");
  WriteFileAtomically(folder_ / "out" / "masked" / "own.txt", "mine");
  const CommandResult again = RunCommand(words);
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_EQ(ReadFile(folder_ / "out" / "masked" / "own.txt"), "mine") << "the folder went with all that was in it";
  EXPECT_THAT(again.err, Not(HasSubstr(":masked"))) << "no clip is painted twice";
  EXPECT_EQ(Numbers(folder_ / "out"), numbers);
}

/// A suite to which a checkpoint is added asks for that one alone, and one of fewer policies for nothing.
TEST_F(FidelityRun, TakesOverWhatPoliciesThatBothSuitesHaveDid) {
  const fs::path one = folder_ / "one", two = folder_ / "two", back = folder_ / "back";
  const auto words = [&](const fs::path& out, const std::string& suite, const fs::path& reality) {
    std::vector<std::string> words = Words(out, "open");
    words[2] = suite;
    if (!reality.empty()) words.insert(words.end(), {"--reality", reality.string()});
    return words;
  };
  const CommandResult first = RunCommand(words(one, kSuite, ""));
  ASSERT_EQ(first.exit_code, 0) << first.err;

  const CommandResult second = RunCommand(words(two, SuiteOfTwoPolicies(), one));
  ASSERT_EQ(second.exit_code, 0) << second.err;
  for (const std::string part : {"/closed: 3 ", "/open: 1 "})
    EXPECT_THAT(second.err, HasSubstr(one.string() + part + "episodes taken over"));
  EXPECT_EQ(Store::Open(two / "closed", Store::Mode::kReadOnly).Episodes().size(), 6u);
  EXPECT_THAT(ReadFile(two / "episodes.csv"), HasSubstr("open_loop,take_bottle,visual_pick,poor,3-0000,1,"));

  const CommandResult third = RunCommand(words(back, kSuite, two));
  ASSERT_EQ(third.exit_code, 0) << third.err;
  EXPECT_THAT(third.err, HasSubstr(two.string() + "/closed: 3 episodes taken over"));
  EXPECT_EQ(Store::Open(back / "closed", Store::Mode::kReadOnly).Policies().size(), 1u) << "not the one it does not have";
  EXPECT_EQ(ReadFile(back / "episodes.csv"), ReadFile(one / "episodes.csv"));
  EXPECT_EQ(Numbers(back), Numbers(one));
}

TEST_F(FidelityRun, TakesOverNoOtherRealityAndNoPolicyThatChangedUnderItsName) {
  const fs::path earlier = folder_ / "earlier", out = folder_ / "out";
  fs::create_directories(earlier);
  std::vector<std::string> words = Words(out);
  words.insert(words.end(), {"--reality", earlier.string()});
  const auto complaint = [&](const std::string& about) {
    WriteFileAtomically(earlier / "reality.sha256", about);
    const CommandResult result = RunCommand(words);
    EXPECT_EQ(result.exit_code, 2) << result.err;
    EXPECT_FALSE(fs::exists(out)) << "before anything is written";
    return result.err;
  };
  const std::string zeros(64, '0'), reality = ReadSuite(kSuite, {"worlds.2.weights=" + weights_.string()}).reality_hash;
  EXPECT_THAT(complaint(zeros + "\n"), HasSubstr("reality.sha256:1: found '000"));
  EXPECT_THAT(complaint(zeros + "  reality\n"), HasSubstr("is about another reality (000000000000…"));
  const std::string changed = complaint(reality + "  reality\n" + zeros + "  policy visual_pick@good\n");
  EXPECT_THAT(changed, HasSubstr("visual_pick@good was another policy there (its command or files): not taken over"));
  EXPECT_THAT(changed, HasSubstr("has none of this suite's policies as they are now: there is nothing to take over"));
}

TEST_F(FidelityRun, LooksAtTheClassifierBeforeItAsksReality) {
  std::vector<std::string> words = Words(folder_ / "out");
  words.insert(words.end(), {"--classifier", (folder_ / "none.safetensors").string()});
  const CommandResult result = RunCommand(words);
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_THAT(result.err, HasSubstr("none.safetensors"));
  EXPECT_FALSE(fs::exists(folder_ / "out" / "closed"));
}

TEST_F(FidelityRun, TakesTheSuiteBehindAnOptionForTheSuite) {
  const auto said = [&](const std::vector<std::string>& options) {
    std::vector<std::string> words = {Binary("evac"), "fidelity"};
    words.insert(words.end(), options.begin(), options.end());
    words.insert(words.end(), {kSuite, "--out", (folder_ / "out").string(), "--parts", "none"});
    return RunCommand(words).err;
  };
  EXPECT_THAT(said({"--parts", "closed,open"}), HasSubstr("--parts: found 'none', wanted some of"));
  EXPECT_THAT(said({"--set", "lanes=1"}), HasSubstr("--parts: found 'none', wanted some of"));
}

TEST_F(FidelityRun, SaysWhichWorldTheSuiteLacks) {
  std::vector<std::string> words = Words(folder_ / "out");
  words[2] = EVAC_SOURCE_DIR "/tests/system/imagined.yaml";
  words[6] = "worlds.1.weights=" + weights_.string();
  const CommandResult result = RunCommand(words);
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_THAT(result.err, HasSubstr("wanted another of type mujoco with the real world's profile"));
}

/// Four recordings, one too short to be replayed and one of a robot without a left arm.
void WriteRecordings(const fs::path& root) {
  for (const auto& [name, steps] : {std::pair{"one", 120}, {"two", 90}, {"short", 9}, {"one_armed", 90}}) {
    SyntheticClip clip(steps);
    clip.cameras = {"head", "hand_right"};
    std::ranges::fill(clip.grippers, 60.0F);  // half closed
    if (name == std::string("one_armed")) clip.LoseLeftArm();
    fs::create_directories(root / name);
    clip.Write(OneFolder(root / name));
  }
}

/// With recordings of its own, and weights of both arms.
class RecordedFidelityRun : public FidelityRun {
 protected:
  RecordedFidelityRun() {
    WriteRecordings(folder_ / "mine");
    nn::RandomWeights random(5);
    nn::SaveWeights(weights_, random, ReadEvacConfig(EVAC_SOURCE_DIR "/tests/system/evac_small.yaml"),
                    {.metadata = {{"arms", "left,right"}}});
  }

  CommandResult Run(const fs::path& out, const std::vector<std::string>& assignments = {}) const {
    std::vector<std::string> words = {
        Binary("evac"), "fidelity", EVAC_SOURCE_DIR "/apps/configs/fidelity_recordings.yaml", "--out", out.string(),
        "--set", "recording=" + (folder_ / "mine").string(), "--set", "worlds.1.weights=" + weights_.string(), "--set",
        "worlds.1.config=" EVAC_SOURCE_DIR "/tests/system/evac_small.yaml", "--set",
        "worlds.1.statistics=" EVAC_SOURCE_DIR "/apps/configs/robots/agibotworld.yaml"};
    for (const std::string& assignment : assignments) words.insert(words.end(), {"--set", assignment});
    return RunCommand(words);
  }
};

/// An episode as `evac collect` leaves it, its video `scale` pixels to one of the pictures.
void WriteCollected(const fs::path& root, int scale) {
  constexpr int kSteps = 17, kWidth_px = 48, kHeight_px = 32;
  const TreePlace place{root, "carry", "000000"};
  RecordedEpisode episode;
  for (const auto& [name, mount] : {std::pair{"head", Mount::kBase}, {"hand_right", Mount::kRightGripper}})
    episode.cameras.push_back({name, kWidth_px, kHeight_px, 40, 40, 24, 16, mount, SyntheticClip::MountFromCamera()});
  for (int step = 0; step < kSteps; ++step) {
    ArmState left, right;
    left.base_from_gripper = Eigen::Translation3d(0.4 + 0.01 * step, 0.2, 0.3);
    right.base_from_gripper = Eigen::Translation3d(0.4 + 0.01 * step, -0.2, 0.3);
    left.closure = right.closure = 0.5;
    episode.arms.push_back({left, right});
    cv::Mat picture(kHeight_px, kWidth_px, CV_8UC3);
    for (int y = 0; y < kHeight_px; ++y) {
      for (int x = 0; x < kWidth_px; ++x)
        picture.at<cv::Vec3b>(y, x) = cv::Vec3b::all(static_cast<uchar>(40 + 2 * x + 2 * y + step));
    }
    episode.pictures.push_back({picture, picture});
  }
  episode.told = episode.arms;
  WriteRecording(place, episode, {.crf = 1, .scale = scale});
  WriteTruth(TruthPath(place),
             {{"head", "hand_right"}, std::vector<float>(kSteps * 4, 1), std::vector<std::uint8_t>(kSteps, 0)});
  CollectedEpisode row;
  row.task = place.task;
  row.episode = row.initial_state = place.episode;
  row.stop = "still";
  row.frames = kSteps;
  row.video_scale = scale;
  WriteText(RowPath(place), CollectedJson(row));
}

/// A collection's doubled pixels were held against imagined pictures that were made as large: other dB than the same
/// episodes in videos of the pictures' size, and pixels of half the size.
TEST_F(RecordedFidelityRun, MeasuresACollectionInItsPicturesPixelsHoweverLargeItsVideosAre) {
  std::vector<std::vector<double>> psnr;
  for (const int scale : {1, 2}) {
    const fs::path collection = folder_ / fmt::format("collected_{}", scale);
    const fs::path out = folder_ / fmt::format("out_{}", scale);
    WriteCollected(collection, scale);
    const CommandResult result = Run(out, {"recording=" + collection.string()});
    ASSERT_EQ(result.exit_code, 0) << result.err;
    const Store store = Store::Open(out / "open", Store::Mode::kReadOnly);
    ASSERT_EQ(store.Tasks().size(), 1u);
    for (const Camera& camera : store.Tasks().front().cameras) {
      EXPECT_EQ(camera.width_px, 48) << camera.name << " of scale " << scale;
      EXPECT_DOUBLE_EQ(camera.fx_px, 40) << camera.name << " of scale " << scale;
    }
    psnr.push_back(Numbers(out)["open_loop"]["psnr_by_chunk"].get<std::vector<double>>());
  }
  ASSERT_EQ(psnr[0].size(), 2u);
  EXPECT_THAT(psnr[1], testing::Pointwise(testing::DoubleNear(0.3), psnr[0]));
}

TEST_F(RecordedFidelityRun, ReplaysAsManyAndAsLongAsTheSuiteSays) {
  const fs::path out = folder_ / "out";
  const CommandResult result = Run(out, {"initial_states={count: 1}", "max_chunks=1"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const nlohmann::json numbers = Numbers(out);
  EXPECT_EQ(numbers["parts"][0]["episodes"], 2) << "one recording, and what the model imagined of it";
  EXPECT_EQ(numbers["open_loop"]["psnr_by_chunk"].size(), 2u) << "one chunk of 16 actions, two of the network's";
  const CommandResult three = Run(folder_ / "three", {"initial_states={count: 3}"});
  EXPECT_EQ(three.exit_code, 2) << three.err;
  EXPECT_THAT(three.err, HasSubstr("field initial_states.count: found 3, wanted at most 2: so many recordings of"));
}

TEST_F(RecordedFidelityRun, ComparesPicturesAndSaysWhatWasLeftOut) {
  const fs::path out = folder_ / "out";
  const CommandResult result = Run(out);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.err, HasSubstr("2 recordings left out: 1 other_robot, 1 too_short"));
  EXPECT_THAT(result.err, HasSubstr("one_armed: found arms right, wanted left, right"));
  const nlohmann::json numbers = Numbers(out);
  EXPECT_EQ(numbers["open_loop"]["psnr_by_chunk"].size(), 4u) << "120 steps at 30 Hz are 40 at 10 Hz: 4 chunks of 8";
  EXPECT_TRUE(numbers["pearson"].is_null());
  EXPECT_EQ(numbers["open_loop"]["n"], 0) << "nobody says how they ended";
  const std::string page = ReadFile(out / "index.html");
  EXPECT_THAT(page, HasSubstr("2 recordings replayed"));
  EXPECT_THAT(page, HasSubstr("<video"));
}

}  // namespace
}  // namespace evac
