#include "harness/merge.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <future>

#include "core/error.h"
#include "core/file.h"
#include "core/store_calls.h"
#include "tests/core/store_samples.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

/// A run of two episodes from one initial state, and an empty one to take them into.
class TakenEpisodes : public testing::Test {
 protected:
  TakenEpisodes() {
    for (Store* store : {&from_, &to_}) samples::Declare(*store);
    for (const EpisodeKey& key : {first_, second_}) {
      from_.Add(samples::SomeEpisode(from_, key));
      from_.AddInitialScene(key.pair, Scene());
    }
  }

  static InitialScene Scene() {
    SplitMix64 random(9);
    return {{samples::Image(5), samples::Image(6)}, samples::SomeArms(random), samples::SomeTask().cameras};
  }

  int Take(const EpisodeKey& wanted) {
    return TakeEpisodes(from_, [&](const EpisodeKey& key) { return key == wanted; }, to_);
  }

  const TempFolder folder_;
  const EpisodeKey first_ = samples::Key(1, "real"), second_ = samples::Key(2, "real");
  Store from_ = Store::InMemory(folder_ / "from", samples::SomeRun()), to_ = Store::InMemory(folder_ / "to", samples::SomeRun());
};

TEST_F(TakenEpisodes, BringTheSceneTheyBeganInAlsoWhereAnotherEpisodeOwnsIt) {
  ASSERT_EQ(from_.InitialScenes(), std::vector<PairKey>{first_.pair}) << "the first of the two owns it";
  EXPECT_EQ(Take(second_), 1);
  const auto scene = to_.LoadInitialScene("take_bottle", second_.pair.initial_state);
  ASSERT_TRUE(scene);
  EXPECT_EQ(cv::norm(scene->images.at(1), Scene().images[1], cv::NORM_INF), 0);
}

TEST_F(TakenEpisodes, BringTheirSceneAlsoWhereTheyAreThereWithoutIt) {
  to_.Add(samples::SomeEpisode(to_, second_));
  EXPECT_EQ(Take(second_), 0);
  EXPECT_TRUE(to_.LoadInitialScene("take_bottle", second_.pair.initial_state)) << "an earlier evac left it behind";
}

TEST_F(TakenEpisodes, BringNoSceneOfAStateThatNobodyWants) {
  EpisodeKey elsewhere = first_;
  elsewhere.pair.initial_state = "41-0008";
  EXPECT_EQ(Take(elsewhere), 0);
  EXPECT_TRUE(to_.InitialScenes().empty());
}

/// Two shards on disk, and what is merged from them.
class MergedRuns : public testing::Test {
 protected:
  MergedRuns() {
    for (Store* store : {&a_, &b_}) samples::Declare(*store);
  }

  MergeSummary Merge(const std::string& out = "merged") { return MergeRuns({a_.folder(), b_.folder()}, folder_ / out); }

  /// What was said in the merged run, oldest first: "judge: reason".
  std::vector<std::string> Said() const {
    std::vector<std::string> said;
    for (const Verdict& verdict : Store::Open(folder_ / "merged", Store::Mode::kReadOnly).Verdicts())
      said.push_back(verdict.judge + ": " + verdict.reason);
    return said;
  }

  Verdict Says(const std::string& judge, const std::string& reason) const {
    Verdict verdict;
    verdict.episode_id = key_.Id();
    verdict.judge = judge;
    verdict.label = Label::kSuccess;
    verdict.reason = reason;
    return verdict;
  }

  const TempFolder folder_;
  const EpisodeKey key_ = samples::Key(1, "real"), other_ = samples::Key(2, "real");
  Store a_ = Store::CreateOrContinue(folder_ / "a", samples::SomeRun()),
        b_ = Store::CreateOrContinue(folder_ / "b", samples::SomeRun());
};

TEST_F(MergedRuns, AreWhereTheyWereWantedAlsoWithASlashBehindTheName) {
  a_.Add(samples::SomeEpisode(a_, key_));
  EXPECT_EQ(Merge("merged/").episodes, 1);
  EXPECT_TRUE(Store::Open(folder_ / "merged", Store::Mode::kReadOnly).Has(key_));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "merged.tmp"));
  EXPECT_THROW(Merge("merged/"), Error) << "it is there now";
  EXPECT_THROW(MergeRuns({a_.folder()}, ""), Error);
}

TEST_F(MergedRuns, KeepTheVerdictsOfTheCopyThatWasNotTakenAndSayOnceWhatBothSay) {
  for (Store* store : {&a_, &b_}) store->Add(samples::SomeEpisode(*store, key_));
  a_.AddVerdict(Says("oracle", "it stands"));
  b_.AddVerdict(Says("oracle", "it stands"));
  b_.AddVerdict(Says("human:night:r1", "I saw it"));
  EXPECT_EQ(Merge().duplicates, 1);
  EXPECT_EQ(Said(), (std::vector<std::string>{"oracle: it stands", "human:night:r1: I saw it"}));
}

/// The order of the shards decided which scene was the run's, once what was imagined came with them.
TEST_F(MergedRuns, BeginWhereTheLowestSeedDidWhicheverShardHasIt) {
  for (const auto& [store, seed] : {std::pair(&a_, 2), std::pair(&b_, 1)}) {
    store->AddWorld({.name = "model", .type = "evac", .is_real = false, .profile_hash = "e7ac"});
    store->AddInitialScene(samples::Key(seed).pair, {{samples::Image(seed)}, Arms(1), samples::SomeTask().cameras});
    store->Add(samples::SomeEpisode(*store, samples::Key(seed, "model")));
  }
  Merge("ab");
  MergeRuns({b_.folder(), a_.folder()}, folder_ / "ba");
  for (const char* out : {"ab", "ba"})
    EXPECT_EQ(Store::Open(folder_ / out, Store::Mode::kReadOnly).InitialScenes().at(0).seed, 1u) << out;
}

/// The last verdict of a judge counts: an older copy beside a newer one brought an outdated one back.
TEST_F(MergedRuns, GoOnWithTheLongerOfTwoListsOfOneJudge) {
  for (Store* store : {&a_, &b_}) {
    store->Add(samples::SomeEpisode(*store, key_));
    store->AddVerdict(Says("oracle", "it stands"));
    store->AddVerdict(Says("oracle", "it fell"));
  }
  b_.AddVerdict(Says("oracle", "it stands"));
  Merge();
  EXPECT_EQ(Said(), (std::vector<std::string>{"oracle: it stands", "oracle: it fell", "oracle: it stands"}));
}

/// Contacts were not compared, and of what was, no test would have missed any.
TEST_F(MergedRuns, RefuseTwoUnfilmedEpisodesThatDifferInOneThingAlone) {
  const std::vector<std::pair<std::string, std::function<void(EpisodeRecord&)>>> changes = {
      {"nothing", [](EpisodeRecord&) {}},
      {"command", [](EpisodeRecord& r) { r.episode.commands[1][0].base_from_gripper.translation().x() += .001; }},
      {"observed arm", [](EpisodeRecord& r) { r.episode.observations[2].arms[0].base_from_gripper.translation().y() += .001; }},
      {"closure", [](EpisodeRecord& r) { r.episode.observations[2].arms[0].closure /= 2; }},
      {"body's pose", [](EpisodeRecord& r) { r.privileged[1].bodies[0].base_from_body.translation().z() += .001; }},
      {"contact's force", [](EpisodeRecord& r) { r.privileged[1].contacts[0].force_n += 1; }},
      {"contact's body", [](EpisodeRecord& r) { r.privileged[1].contacts[0].b = "table"; }}};
  for (const auto& entry : changes) {
    const std::string& what = entry.first;
    const std::filesystem::path shards[] = {folder_ / what / "a", folder_ / what / "b"};
    for (const std::filesystem::path& shard : shards) {
      Store store = Store::CreateOrContinue(shard, samples::SomeRun());
      samples::Declare(store);
      EpisodeRecord record = samples::SomeEpisode(store, key_);
      record.video.reset();
      if (shard == shards[1]) entry.second(record);
      store.Add(record);
    }
    const auto merge = [&] { return MergeRuns({shards[0], shards[1]}, folder_ / what / "merged").duplicates; };
    if (what == "nothing") {
      EXPECT_EQ(merge(), 1);
    } else {
      EXPECT_THAT(merge, testing::ThrowsMessage<Error>(testing::HasSubstr(key_.Id()))) << what;
    }
  }
}

/// The first shard's version was said for all: whoever takes episodes over from its own version alone took another's.
TEST_F(MergedRuns, SayEveryVersionThatBeganAShardOnce) {
  RunInfo run = samples::SomeRun();
  const std::string ours = run.evac_version;
  run.evac_version = "0.0.9";
  Store older = Store::CreateOrContinue(folder_ / "older", run);
  samples::Declare(older);
  const auto version = [&](const std::string& out) {
    return Store::Open(folder_ / out, Store::Mode::kReadOnly).run().evac_version;
  };
  EXPECT_TRUE(Merge("alike").notes.empty());
  EXPECT_EQ(version("alike"), ours);
  const MergeSummary mixed = MergeRuns({a_.folder(), older.folder(), b_.folder()}, folder_ / "mixed");
  EXPECT_EQ(version("mixed"), ours + ", 0.0.9");
  ASSERT_EQ(mixed.notes.size(), 1u);
  EXPECT_THAT(mixed.notes[0], testing::HasSubstr(ours + " and 0.0.9"));
  MergeRuns({older.folder(), folder_ / "mixed"}, folder_ / "again");
  EXPECT_EQ(version("again"), "0.0.9, " + ours);
}

/// What was asked of a model server, and paid for, was left behind without a word.
TEST_F(MergedRuns, SayWhichShardsCallsOfModelServersStayBehind) {
  CallCache(b_.folder() / CallCache::kFile).Add({.key = "k", .judge = "vlm:x", .response = "yes", .status = "ok"});
  const MergeSummary summary = Merge();
  ASSERT_EQ(summary.notes.size(), 1u);
  EXPECT_THAT(summary.notes[0], testing::HasSubstr((b_.folder() / CallCache::kFile).string()));
}

TEST_F(MergedRuns, SayWhichShardsLogsStayBehind) {
  MakeFolders(b_.folder() / "logs");
  WriteFileAtomically(b_.folder() / "logs/mine@default.log", "out of memory");
  const MergeSummary summary = Merge();
  ASSERT_EQ(summary.notes.size(), 1u);
  EXPECT_THAT(summary.notes[0], testing::HasSubstr((b_.folder() / "logs").string() + " is not merged"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "merged/logs"));
}

/// A shard that was killed, or was none of those that were merged, was no loss to anybody.
TEST_F(MergedRuns, SayHowManyEpisodesOfTheSuiteNoShardHas) {
  const PairKey& pair = key_.pair;
  const PlannedEpisodes three{pair.task, key_.world, pair.policy, pair.checkpoint, 3};
  a_.AddTask(samples::SomeTask(), "9a9e");
  for (Store* store : {&a_, &b_}) store->AddPlan({three});
  a_.Add(samples::SomeEpisode(a_, key_));
  b_.Add(samples::SomeEpisode(b_, other_));
  const MergeSummary part = Merge("part");
  ASSERT_EQ(part.notes.size(), 1u);
  EXPECT_THAT(part.notes[0], testing::HasSubstr("2 of the suite's 3 episodes are there"));
  const Store merged = Store::Open(folder_ / "part", Store::Mode::kReadOnly);
  EXPECT_EQ(merged.Plan(), std::vector<PlannedEpisodes>{three});
  EXPECT_EQ(merged.PageHashes(), (std::map<std::string, std::string>{{pair.task, "9a9e"}}));
  b_.Add(samples::SomeEpisode(b_, samples::Key(3, "real"), StopReason::kPolicyError));
  EXPECT_TRUE(Merge("whole").notes.empty()) << "one that failed has run";
}

/// Two labs' lists that both count from one: the second's were dropped without a word.
TEST_F(MergedRuns, RefuseRealTrialsOfWhichTwoShardsSayOtherwise) {
  for (Store* store : {&a_, &b_}) store->Add(samples::SomeEpisode(*store, key_));
  RealTrial trial{.task = key_.pair.task, .initial_state = key_.pair.initial_state, .policy = key_.pair.policy, .checkpoint = key_.pair.checkpoint,
                  .trial = 1, .outcome = Label::kSuccess, .video = "", .source = "lab1.csv:2"};
  a_.AddRealTrials({trial});
  trial.source = "copy.csv:2";
  b_.AddRealTrials({trial});
  Merge("alike");
  EXPECT_EQ(Store::Open(folder_ / "alike", Store::Mode::kReadOnly).RealTrials().size(), 1u);
  trial.trial = 2;
  a_.AddRealTrials({trial});
  trial.outcome = Label::kFailure;
  trial.source = "lab2.csv:3";
  b_.AddRealTrials({trial});
  EXPECT_THAT([&] { Merge(); }, testing::ThrowsMessage<Error>(testing::AllOf(testing::HasSubstr("copy.csv:2"), testing::HasSubstr("lab2.csv:3"))));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "merged"));
}

TEST_F(MergedRuns, DoNotRemoveAShardThatIsWhereTheyWouldBeMade) {
  a_.Add(samples::SomeEpisode(a_, key_));
  Merge("all.tmp");
  EXPECT_THAT([&] { MergeRuns({folder_ / "all.tmp"}, folder_ / "all"); }, testing::ThrowsMessage<Error>(testing::HasSubstr("another name")));
  EXPECT_TRUE(std::filesystem::exists(folder_ / "all.tmp"));
}

TEST_F(MergedRuns, DoNotRemoveAShardThatLiesBelowWhereTheyWouldBeMade) {
  a_.Add(samples::SomeEpisode(a_, key_));
  Merge("all.tmp/a");
  EXPECT_THAT([&] { MergeRuns({folder_ / "all.tmp/a"}, folder_ / "all"); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("another name")));
  EXPECT_TRUE(Store::Open(folder_ / "all.tmp/a", Store::Mode::kReadOnly).Has(key_));
}

/// Somebody's own folder of that name went without a word.
TEST_F(MergedRuns, DoNotRemoveWhatNoMergeLeftWhereTheyWouldBeMade) {
  a_.Add(samples::SomeEpisode(a_, key_));
  MakeFolders(folder_ / "merged.tmp");
  WriteFileAtomically(folder_ / "merged.tmp/notes.txt", "mine");
  EXPECT_THAT([&] { Merge(); }, testing::ThrowsMessage<Error>(testing::HasSubstr((folder_ / "merged.tmp").string())));
  EXPECT_EQ(ReadFile(folder_ / "merged.tmp/notes.txt"), "mine");
  EXPECT_FALSE(std::filesystem::exists(folder_ / "merged"));
}

/// A file of the lock's name was written over, and then removed.
TEST_F(MergedRuns, DoNotLockWhatIsNoLock) {
  a_.Add(samples::SomeEpisode(a_, key_));
  WriteFileAtomically(folder_ / "merged.lock", "mine");
  EXPECT_THAT([&] { Merge(); }, testing::ThrowsMessage<Error>(testing::HasSubstr((folder_ / "merged.lock").string())));
  EXPECT_EQ(ReadFile(folder_ / "merged.lock"), "mine");
  WriteFileAtomically(folder_ / "merged.lock", "12345\n");  // of a merge that was killed
  EXPECT_EQ(Merge().episodes, 1);
}

TEST_F(MergedRuns, AreMadeOverWhatAMergeLeftThatWasBrokenOff) {
  a_.Add(samples::SomeEpisode(a_, key_));
  const std::filesystem::path video = a_.folder() / a_.Episodes().at(0).video;
  const std::string bytes = ReadFile(video);
  WriteFileAtomically(video, "other bytes");
  EXPECT_THROW(Merge(), Error);
  ASSERT_TRUE(std::filesystem::exists(folder_ / "merged.tmp"));
  WriteFileAtomically(video, bytes);
  EXPECT_EQ(Merge().episodes, 1);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "merged.tmp"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "merged/merging"));
}

/// Its mark went first: between that and its name it was a folder that no later merge took for its own.
TEST_F(MergedRuns, AreMadeOverWhatAMergeLeftThatWasBrokenOffJustBeforeItHadItsName) {
  a_.Add(samples::SomeEpisode(a_, key_));
  std::filesystem::create_symlink("nowhere", folder_ / "merged");  // in the way of the name alone
  EXPECT_THROW(Merge(), Error);
  ASSERT_TRUE(std::filesystem::exists(folder_ / "merged.tmp/evac.sqlite")) << "it came to the end";
  EXPECT_FALSE(std::filesystem::exists(folder_ / "merged.lock"));
  std::filesystem::remove(folder_ / "merged");
  EXPECT_EQ(Merge().episodes, 1);
  MakeFolders(folder_ / "merged/merging");  // of one that was broken off just behind it
  EXPECT_EQ(Store::Open(folder_ / "merged", Store::Mode::kReadWrite).Episodes().size(), 1u);
  EXPECT_EQ(MergeRuns({folder_ / "merged", b_.folder()}, folder_ / "all").episodes, 1);
}

/// The second looked whether the name is free before it waited for the first.
TEST_F(MergedRuns, OfTwoMergesToOneNameOneIsRefused) {
  a_.Add(samples::SomeEpisode(a_, key_));
  for (int i = 0; i < 20; ++i) {
    const std::string out = "merged" + std::to_string(i);
    std::future<MergeSummary> merges[] = {std::async(std::launch::async, [&] { return Merge(out); }),
                                          std::async(std::launch::async, [&] { return Merge(out); })};
    int made = 0;
    for (std::future<MergeSummary>& merge : merges) {
      try {
        made += merge.get().episodes;
      } catch (const Error& error) {
        EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput) << error.what();
      }
    }
    EXPECT_EQ(made, 1);
    EXPECT_FALSE(std::filesystem::exists(folder_ / (out + ".tmp")));
  }
}

TEST_F(MergedRuns, AreMadeWithTheFoldersAboveThem) {
  a_.Add(samples::SomeEpisode(a_, key_));
  EXPECT_EQ(Merge("new/folder/merged").episodes, 1);
  WriteFileAtomically(folder_ / "file", "no folder");
  try {
    Merge("file/merged");
    ADD_FAILURE() << "it was made in a file";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    EXPECT_THAT(error.what(), testing::HasSubstr((folder_ / "file").string() + ":"));
  }
}

TEST_F(MergedRuns, TakenEpisodesBringTheirVerdictsAlsoAfterACallThatWasKilledBeforeThem) {
  a_.Add(samples::SomeEpisode(a_, key_));
  b_.Add(samples::SomeEpisode(b_, key_));
  b_.AddVerdict(Says("human:night:r1", "I saw it"));
  const auto all = [](const EpisodeKey&) { return true; };
  EXPECT_EQ(TakeEpisodes(b_, all, a_), 0) << "it is there";
  ASSERT_EQ(a_.Verdicts().size(), 1u);
  TakeEpisodes(b_, all, a_);
  EXPECT_EQ(a_.Verdicts().size(), 1u) << "said once";
}

TEST_F(MergedRuns, LoseWhatWasSaidOfAFailedCopyThatYieldedAndDoNotCountItAsTheSame) {
  a_.Add(samples::SomeEpisode(a_, key_, StopReason::kPolicyError));
  a_.AddVerdict(Says("vlm:x", "of the failed one"));
  b_.Add(samples::SomeEpisode(b_, key_));
  b_.AddVerdict(Says("oracle", "of the good one"));
  b_.Add(samples::SomeEpisode(b_, other_, StopReason::kPolicyError));
  const MergeSummary summary = Merge();
  EXPECT_EQ(summary.episodes, 2);
  EXPECT_EQ(summary.duplicates, 0);
  EXPECT_EQ(Said(), std::vector<std::string>{"oracle: of the good one"});
}

/// Its episodes were taken once and its wire's counters twice.
TEST_F(MergedRuns, TakeAFolderThatIsGivenTwiceOnce) {
  a_.Add(samples::SomeEpisode(a_, samples::Key(1, "real")));
  a_.Count("p@a", {{"repeats", 3}});
  const MergeSummary summary = MergeRuns({a_.folder(), b_.folder(), a_.folder() / "."}, folder_ / "merged");
  EXPECT_EQ(summary.episodes, 1);
  EXPECT_EQ(summary.duplicates, 0);
  EXPECT_EQ(Store::Open(folder_ / "merged", Store::Mode::kReadOnly).CountersByPolicy().at("p@a").at("repeats"), 3);
}

}  // namespace
}  // namespace evac
