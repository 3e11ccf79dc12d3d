#include "judges/rating_study.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>

#include "core/error.h"
#include "core/file.h"
#include "core/secret.h"
#include "core/store_lock.h"
#include "core/store_sqlite.h"
#include "core/video.h"
#include "tests/reports/stored_run.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

StudyMade Make(const fs::path& folder, const StudyOptions& options) {
  return MakeStudy(folder, options, [](std::size_t, std::size_t) {});
}

std::vector<StudyClip> ClipsIn(const fs::path& folder) {
  return StudyStore::Open(folder, StudyStore::Mode::kReadOnly).Clips();
}

cv::Mat FirstPicture(const fs::path& folder, const StudyClip& clip) {
  return ReadAllFrames(folder / clip.file).front();
}

bool IsBlack(const cv::Mat& picture, int x_px, int y_px) {
  const cv::Vec3b pixel = picture.at<cv::Vec3b>(y_px, x_px);
  return pixel[0] + pixel[1] + pixel[2] < 30;
}

/// An episode of which there is nothing to see.
void AddUnseen(StoredRun& run, const std::string& state, StopReason stop) {
  EpisodeRecord record;
  record.episode.key = {{"take", state, "pick", "1", 1}, "real"};
  record.episode.stop = stop;
  record.episode.stop_reason = "after 0 chunks";
  run.store().Add(record);
}

/// One more task, whose camera is `height_px` high where that of "take" is 48: of one height it is as much wider.
void AddWide(StoredRun& run, int height_px) {
  Task task = run.store().Tasks().front();
  task.id = "wide";
  task.cameras.front().height_px = height_px;
  run.store().AddTask(task);
  run.AddEpisode({{"wide", "41-0000", "pick", "1", 1}, "real"}, 's');
}

TEST(RatingStudy, StatesAreDrawnOnceForAllRunsSoThatPairsStayPairs) {
  StoredRun real("recorded", std::string(12, 's'), std::string(12, 'f')), imagined("imagined", "", "");
  imagined.store().AddWorld({"dream", "evac", false, "network"});
  for (int i = 0; i < 9; ++i)
    imagined.AddEpisode({{"take", fmt::format("41-{:04d}", i), "pick", "1", 1}, "dream"}, 's');
  for (const std::uint64_t seed : {1, 2}) {
    const fs::path folder = real.folder().parent_path() / fmt::format("study_{}", seed);
    Make(folder, {.runs = {real.folder(), imagined.folder()}, .seed = seed, .height_px = 64, .states = 4});
    std::map<std::string, std::set<std::string>> states;  // by world
    for (const StudyClip& clip : ClipsIn(folder)) states[clip.world].insert(clip.initial_state);
    EXPECT_EQ(states["real"].size(), 4u);
    EXPECT_EQ(states["sim"], states["real"]);
    std::set<std::string> in_both;
    for (const std::string& state : states["real"]) {
      if (state < "41-0009") in_both.insert(state);
    }
    EXPECT_EQ(states["dream"], in_both) << "seed " << seed;
  }
}

/// One more state, and all of them were drawn anew: the study had other states, and pairs were torn.
TEST(RatingStudy, TheSameCommandLaterKeepsToTheStatesThatTheStudyHas) {
  StoredRun run("begun", std::string(8, 's'), std::string(8, 'f'));
  const fs::path folder = run.folder().parent_path() / "study";
  const StudyOptions options{.runs = {run.folder()}, .height_px = 64, .states = 3};
  const auto states_of = [&](int wave) {
    std::set<std::string> states;
    for (const StudyClip& clip : ClipsIn(folder)) {
      if (clip.wave == wave) states.insert(clip.initial_state);
    }
    return states;
  };
  Make(folder, options);
  const std::set<std::string> begun = states_of(1);
  ASSERT_EQ(begun.size(), 3u);
  for (int i = 0; i < 4; ++i) run.Add(fmt::format("42-{:04d}", i), 's', 's');
  for (int i = 0; i < 8; ++i) run.AddEpisode({{"take", fmt::format("41-{:04d}", i), "pick", "1", 2}, "sim"}, 's');
  EXPECT_EQ(Make(folder, options).clips, 3) << "one of each state that is in it";
  EXPECT_EQ(states_of(2), begun);
  StudyOptions more = options;
  more.states = 5;
  Make(folder, more);
  EXPECT_EQ(states_of(3).size(), 2u) << "what is missing to five";
  for (const std::string& state : states_of(3)) EXPECT_FALSE(begun.contains(state)) << state;
}

TEST(RatingStudy, WhichStatesAreDrawnIsNoMatterOfHowManyOthersThereAre) {
  const StoredRun few("few", std::string(6, 's'), std::string(6, 'f'));
  const StoredRun many("many", std::string(9, 's'), std::string(9, 'f'));
  const auto drawn_of = [](const StoredRun& run) {
    const fs::path folder = run.folder().parent_path() / "study";
    Make(folder, {.runs = {run.folder()}, .height_px = 64, .states = 4});
    std::set<std::string> states;
    for (const StudyClip& clip : ClipsIn(folder)) states.insert(clip.initial_state);
    return states;
  };
  const std::set<std::string> of_few = drawn_of(few);
  for (const std::string& state : drawn_of(many))
    EXPECT_TRUE(state >= "41-0006" || of_few.contains(state)) << state << ": one that came since has moved another in";
}

TEST(RatingStudy, OnlyStatesWithAClipAreDrawn) {
  StoredRun run("gaps", "sf", "fs");
  for (int i = 0; i < 10; ++i) {
    AddUnseen(run, fmt::format("42-{:04d}", i), StopReason::kPolicyError);
    AddUnseen(run, fmt::format("43-{:04d}", i), StopReason::kMaxChunks);
  }
  const fs::path folder = run.folder().parent_path() / "study";
  const StudyMade made = Make(folder, {.runs = {run.folder()}, .height_px = 64, .states = 2});
  EXPECT_EQ(made.clips, 4) << "two states in two worlds";
  EXPECT_THAT(made.left_out, testing::ElementsAre(HasSubstr("10 failed episodes"), HasSubstr("10 episodes without")));
}

/// Examples and practice, which are in no rate, were by turns a success and a failure: of 36 and 12 clips 30 and 6 were
/// left, 83 % instead of 75 %. Imagined clips, of which nobody knows the outcome, lost none.
TEST(RatingStudy, WhatIsLeftToRateHasTheShareOfSuccessesOfWhatIsKnown) {
  std::string mostly, rarely;
  for (int i = 0; i < 6; ++i) mostly += "sssf", rarely += "fffs";
  const std::vector<std::pair<std::string, int>> cases = {{mostly, 27}, {rarely, 9}, {std::string(23, 's') + "f", 35}};
  for (const auto& [outcomes, successes_left] : cases) {
    const StoredRun run("known", outcomes, outcomes);
    const fs::path folder = run.folder().parent_path() / "study";
    const StudyMade made = Make(folder, {.runs = {run.folder()}, .height_px = 64, .gold_from = "oracle"});
    EXPECT_EQ(made.examples, 4);
    EXPECT_EQ(made.practice, 8);
    EXPECT_EQ(made.gold, 12);
    const auto verdicts = run.store().CurrentVerdicts();
    std::map<Showing, std::map<Label, int>> of_use;
    for (const StudyClip& clip : ClipsIn(folder)) ++of_use[clip.use][verdicts.at(clip.episode).at("oracle").label];
    const int left = of_use[Showing::kCounted][Label::kSuccess] + of_use[Showing::kGold][Label::kSuccess];
    EXPECT_EQ(left, successes_left) << "of 36; all were " << outcomes;
    EXPECT_EQ(of_use[Showing::kExample].size(), 2u) << "both kinds are shown before: " << outcomes;
  }
}

/// A separator at its end or a link made another run of it, whose clips came in a second time; named twice at once, all
/// was encoded and then "UNIQUE constraint failed" left a study without clips.
TEST(RatingStudy, ARunIsOneHoweverOftenAndByWhateverPathItIsNamed) {
  const StoredRun run("run", "s", "f");
  const fs::path folder = run.folder().parent_path() / "study", link = run.folder().parent_path() / "link";
  fs::create_directory_symlink(run.folder(), link);
  const std::vector<fs::path> names = {run.folder(), run.folder() / "", link, link / ""};
  EXPECT_EQ(Make(folder, {.runs = names, .height_px = 64}).clips, 2);
  for (const StudyClip& clip : ClipsIn(folder)) EXPECT_EQ(clip.run, fs::canonical(run.folder()).string());
  const auto expect_that_all_is_there = [&] {
    for (const fs::path& name : names) {
      EXPECT_THAT([&] { Make(folder, {.runs = {name}}); },
                  testing::ThrowsMessage<Error>(HasSubstr("every clip of these runs is in it already")))
          << name;
    }
  };
  expect_that_all_is_there();
  for (const fs::path& as_before : {run.folder() / "", link}) {  // how earlier versions wrote it
    sqlite::Connection::OpenReadWrite(folder / "study.sqlite")
        .RunScript(fmt::format("DROP TRIGGER IF EXISTS clips_hold; UPDATE clips SET run = '{}'", as_before.string()));
    expect_that_all_is_there();
  }
}

TEST(RatingStudy, AStudyHasItsFoldersNameWhateverStandsBehindIt) {
  const StoredRun run("run", "s", "f");
  const fs::path folder = run.folder().parent_path() / "robots";
  Make(folder / "", {.runs = {run.folder()}, .height_px = 64});
  EXPECT_EQ(StudyStore::Open(folder, StudyStore::Mode::kReadOnly).info().name, "robots");
}

/// It was refused: "its clips went through none".
TEST(RatingStudy, ACallThatWasKilledBetweenTheStudyAndItsFirstWaveGoesOnWithItsCodec) {
  StoredRun run("run", "s", "f");
  const fs::path whole = run.folder().parent_path() / "whole", folder = run.folder().parent_path() / "study";
  StudyOptions options{.runs = {run.folder()}, .height_px = 64};
  options.round_trip = {"c0dec", [](const cv::Mat& picture) { return picture.clone(); }};
  Make(whole, options);
  StudyStore::Create(folder, StudyStore::Open(whole, StudyStore::Mode::kReadOnly).info());
  EXPECT_EQ(Make(folder, options).clips, 2);
  EXPECT_EQ(StudyStore::Open(folder, StudyStore::Mode::kReadOnly).Codec(), "c0dec");
  run.Add("41-0007", 's', 's');
  options.round_trip = {};
  EXPECT_THAT([&] { Make(folder, options); },
              testing::ThrowsMessage<Error>(HasSubstr("its clips went through the codec c0dec")));
}

TEST(RatingStudy, AWaveWithoutAHeightIsAsLargeAsTheFirst) {
  StoredRun run("begun", "s", "f");
  const fs::path folder = run.folder().parent_path() / "study";
  Make(folder, {.runs = {run.folder()}, .height_px = 720});
  run.Add("41-0007", 's', 's');
  Make(folder, {.runs = {run.folder()}});
  const std::vector<StudyClip> clips = ClipsIn(folder);
  ASSERT_EQ(clips.size(), 4u);
  EXPECT_EQ(clips.back().wave, 2);
  for (const StudyClip& clip : clips) {
    EXPECT_EQ(clip.views, clips.front().views) << "wave " << clip.wave;
    EXPECT_FALSE(IsBlack(FirstPicture(folder, clip), 300, 20)) << "wave " << clip.wave;
  }
}

TEST(RatingStudy, AWaveOfAnotherHeightIsRefused) {
  StoredRun run("begun", "s", "f");
  const fs::path folder = run.folder().parent_path() / "study";
  Make(folder, {.runs = {run.folder()}, .height_px = 65});
  run.Add("41-0007", 's', 's');
  EXPECT_THAT([&] { Make(folder, {.runs = {run.folder()}, .height_px = 96}); },
              testing::ThrowsMessage<Error>(HasSubstr("--height: found 96, but " + folder.string() +
                                                      " was begun with 66, and a wave cannot change that")));
  EXPECT_EQ(ClipsIn(folder).size(), 2u);
  Make(folder, {.runs = {run.folder()}, .height_px = 65});
  EXPECT_EQ(ClipsIn(folder).size(), 4u) << "the same command adds what came since";
}

TEST(RatingStudy, AWaveWithAWiderTaskIsMadeSmallerInsteadOfEndingInAnAssertion) {
  StoredRun run("begun", "s", "f");
  const fs::path folder = run.folder().parent_path() / "study";
  Make(folder, {.runs = {run.folder()}, .height_px = 128});
  AddWide(run, 32);
  Make(folder, {.runs = {run.folder()}});
  const StudyInfo info = StudyStore::Open(folder, StudyStore::Mode::kReadOnly).info();
  EXPECT_EQ(info.width_px, 170);
  const StudyClip wide = ClipsIn(folder).back();
  ASSERT_EQ(wide.task, "wide");
  const cv::Mat picture = FirstPicture(folder, wide);
  EXPECT_EQ(picture.size(), cv::Size(170, 128));
  EXPECT_FALSE(IsBlack(picture, 85, 64));
  EXPECT_FALSE(IsBlack(picture, 85, 30)) << "as large as it fits: 168x84";
  EXPECT_TRUE(IsBlack(picture, 85, 8));
}

/// It began anew, and the clips that were encoded stayed for ever.
TEST(RatingStudy, ACallThatWasBrokenOffGoesOnAndLeavesNothingBehind) {
  StoredRun run("broken", "sf", "fs");
  const fs::path whole = run.folder().parent_path() / "whole", folder = run.folder().parent_path() / "study";
  const StudyOptions options{.runs = {run.folder()}, .height_px = 64};
  Make(whole, options);
  struct BrokenOff {};
  const auto break_off = [](std::size_t done, std::size_t) {
    if (done == 3) throw BrokenOff();
  };
  EXPECT_THROW(MakeStudy(folder, options, break_off), BrokenOff);
  EXPECT_FALSE(StudyStore::IsIn(folder));
  WriteFileAtomically(folder / "clips" / (NewSecret() + ".mp4"), "of a call that an earlier evac broke off");
  const std::vector<Episode> episodes = run.store().Episodes();
  for (std::size_t i = 0; i < 3; ++i) fs::remove(run.folder() / episodes[i].video);  // encoded already: not read again
  EXPECT_EQ(Make(folder, options).clips, 4);
  const std::vector<StudyClip> clips = ClipsIn(folder), wanted = ClipsIn(whole);
  std::set<fs::path> named, there;
  for (std::size_t i = 0; i < clips.size(); ++i) {
    named.insert(folder / clips[i].file);
    EXPECT_EQ(clips[i].episode, wanted.at(i).episode);
    EXPECT_EQ(clips[i].frames, wanted.at(i).frames);
    EXPECT_EQ(clips[i].video_sha256, wanted.at(i).video_sha256);
    EXPECT_NE(clips[i].file, wanted.at(i).file) << "who knows one study knows no name of another's clips";
  }
  for (const auto& entry : fs::directory_iterator(folder / "clips")) there.insert(entry.path());
  EXPECT_EQ(there, named);
}

TEST(RatingStudy, ASecondCallAtOnceIsRefusedBeforeItsHour) {
  StoredRun run("twice", "s", "f");
  const fs::path folder = run.folder().parent_path() / "study";
  MakeFolders(folder);
  const RunLock lock(folder / "new.lock");
  EXPECT_THAT([&] { Make(folder, {.runs = {run.folder()}, .height_px = 64}); },
              testing::ThrowsMessage<Error>(HasSubstr("is writing here")));
}

/// It was left out as one whose clip is there already, and votes on that clip would have been taken for votes on it.
TEST(RatingStudy, AnEpisodeThatIsAnotherByNowIsRefusedWithBothVideos) {
  StoredRun run("run", "s", "f"), other("other", "s", "f", 16);
  const fs::path folder = run.folder().parent_path() / "study";
  Make(folder, {.runs = {run.folder()}, .height_px = 64});
  const std::string before = run.store().Episodes().front().video_sha256;
  const std::string after = other.store().Episodes().front().video_sha256;
  { const Store closed = std::move(run.store()), too = std::move(other.store()); }
  fs::remove_all(run.folder());
  fs::copy(other.folder(), run.folder(), fs::copy_options::recursive);
  EXPECT_THAT([&] { Make(folder, {.runs = {run.folder()}}); },
              testing::ThrowsMessage<Error>(testing::AllOf(HasSubstr(before), HasSubstr(after))));
  EXPECT_EQ(ClipsIn(folder).size(), 2u);
}

/// Raters were told of success: "A recording has no rubric of its own."
TEST(RatingStudy, ATaskOfWhichNobodySaidWhatSuccessIsIsRefusedByNameBeforeAnythingIsMade) {
  StoredRun run("begun", "s", "f");
  Task bare = run.store().Tasks().front();
  bare.id = "bare";
  bare.rubric = {};
  bare.rubric.version = kNoRubric;
  run.store().AddTask(bare);
  const fs::path folder = run.folder().parent_path() / "study";
  Make(run.folder().parent_path() / "without_its_clips", {.runs = {run.folder()}, .height_px = 64});
  run.AddEpisode({{"bare", "41-0000", "pick", "1", 1}, "real"}, 's');
  EXPECT_THAT([&] { Make(folder, {.runs = {run.folder()}, .height_px = 64}); },
              testing::ThrowsMessage<Error>(testing::AllOf(
                  HasSubstr(run.folder().string() + ": task bare has no rubric"), HasSubstr("`rubric: {success: …}`"))));
  EXPECT_FALSE(fs::exists(folder));
}

/// Whoever marked the seventeenth lost the vote: the server took no such verdict.
TEST(RatingStudy, ATaskWithMoreStagesThanAVerdictHoldsIsRefusedByName) {
  StoredRun run("begun", "s", "f");
  Task task = run.store().Tasks().front();
  for (const int stages : {16, 17}) {
    task.id = fmt::format("long_{}", stages);
    task.rubric.stages.resize(static_cast<std::size_t>(stages));
    for (int k = 0; k < stages; ++k) task.rubric.stages[static_cast<std::size_t>(k)].name = fmt::format("s{}", k);
    run.store().AddTask(task);
  }
  const fs::path folder = run.folder().parent_path() / "study";
  run.AddEpisode({{"long_16", "41-0000", "pick", "1", 1}, "real"}, 's');
  EXPECT_EQ(Make(folder, {.runs = {run.folder()}, .height_px = 64}).clips, 3);
  run.AddEpisode({{"long_17", "41-0000", "pick", "1", 1}, "real"}, 's');
  EXPECT_THAT([&] { Make(folder, {.runs = {run.folder()}}); },
              testing::ThrowsMessage<Error>(
                  HasSubstr(run.folder().string() + ": the rubric of task long_17 has 17 stages, wanted at most 16")));
  EXPECT_EQ(ClipsIn(folder).size(), 3u);
}

/// Of a task it ended with 4 in "map::at"; of a world, what was recorded in it was taken for a model's.
TEST(RatingStudy, ARunWithoutTheRowOfATaskOrAWorldIsRefusedAsDamaged) {
  const std::pair<const char*, const char*> damages[] = {
      {"DELETE FROM tasks", "names task 'take'"}, {"DELETE FROM worlds WHERE name = 'real'", "names world 'real'"}};
  for (const auto& [sql, what] : damages) {
    const StoredRun run("damaged", "s", "f");
    sqlite::Connection::OpenReadWrite(run.folder() / "evac.sqlite")
        .RunScript(std::string("PRAGMA foreign_keys = OFF; ") + sql);
    try {
      Make(run.folder().parent_path() / "study", {.runs = {run.folder()}, .height_px = 64});
      ADD_FAILURE() << sql;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      EXPECT_THAT(error.what(),
                  testing::AllOf(HasSubstr(run.folder().string() + ": the run is damaged"), HasSubstr(what)));
    }
  }
}

/// Those of a later wave were as long as that wave's longest: who looked at lengths knew which came later.
TEST(RatingStudy, AWavesClipsAreAsLongInBytesAsThoseThatAreThereOrItIsSaid) {
  StoredRun run("begun", "s", "f");
  const fs::path folder = run.folder().parent_path() / "study";
  const StudyOptions options{.runs = {run.folder()}, .height_px = 64};
  const auto make_all_so_long = [&](std::uintmax_t bytes) {  // as if of other pictures
    for (const StudyClip& clip : ClipsIn(folder)) fs::resize_file(folder / clip.file, bytes);
  };
  EXPECT_THAT(Make(folder, options).warnings, testing::IsEmpty());
  const std::uintmax_t bytes = 3 * fs::file_size(folder / ClipsIn(folder).front().file);
  make_all_so_long(bytes);
  run.Add("41-0007", 's', 's');
  EXPECT_THAT(Make(folder, options).warnings, testing::IsEmpty());
  ASSERT_EQ(ClipsIn(folder).back().wave, 2);
  for (const StudyClip& clip : ClipsIn(folder))
    EXPECT_EQ(fs::file_size(folder / clip.file), bytes) << "wave " << clip.wave;
  make_all_so_long(100);
  run.Add("41-0008", 's', 's');
  EXPECT_THAT(Make(folder, options).warnings, testing::ElementsAre(HasSubstr("those before 100: who looks")));
}

TEST(RatingStudy, ATaskThatFitsIntoNoClipOfTheStudyIsRefusedByName) {
  StoredRun run("begun", "s", "f");
  const fs::path folder = run.folder().parent_path() / "study";
  Make(folder, {.runs = {run.folder()}, .height_px = 64});
  AddWide(run, 24);
  EXPECT_THAT([&] { Make(folder, {.runs = {run.folder()}}); },
              testing::ThrowsMessage<Error>(HasSubstr("task wide: its views are 170 px wide if they are 64 px high, "
                                                      "wanted at most 86")));
  EXPECT_EQ(ClipsIn(folder).size(), 2u);
}

}  // namespace
}  // namespace evac
