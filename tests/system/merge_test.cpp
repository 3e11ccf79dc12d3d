#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "core/store.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using system_test::kFaults;
using system_test::List;
using system_test::RunWords;
using testing::AllOf;
using testing::HasSubstr;

const std::vector<std::string> kFive = {"initial_states.count=5", "judges=[oracle]"};

CommandResult RunShard(const fs::path& run, const std::string& shard, std::vector<std::string> assignments = kFive) {
  std::vector<std::string> words = RunWords(kFaults, run, assignments);
  words.insert(words.end(), {"--shard", shard});
  return RunCommand(words);
}

CommandResult Merge(const std::vector<fs::path>& shards, const fs::path& out) {
  std::vector<std::string> words = {Binary("evac"), "merge", "--out", out.string()};
  for (const fs::path& shard : shards) words.push_back(shard.string());
  return RunCommand(words);
}

/// One run, whole and in two halves, each made once, when it is first wanted.
const TempFolder& RunsFolder() {
  static const TempFolder folder;
  return folder;
}

const fs::path& Whole() {
  static const fs::path run = [] {
    EXPECT_EQ(RunCommand(RunWords(kFaults, RunsFolder() / "whole", kFive)).exit_code, 0);
    return RunsFolder() / "whole";
  }();
  return run;
}

fs::path Half(const std::string& number) {
  const fs::path run = RunsFolder() / number;
  if (!fs::exists(run)) {
    EXPECT_EQ(RunShard(run, number + "/2").exit_code, 0);
  }
  return run;
}

TEST(Merge, ShardsJoinedAreTheRunThatWasNeverSplit) {
  const std::size_t one = Store::Open(Half("1"), Store::Mode::kReadOnly).Episodes().size(),
                    two = Store::Open(Half("2"), Store::Mode::kReadOnly).Episodes().size();
  EXPECT_EQ(one + two, 5u);
  const TempFolder folder;
  const CommandResult merged = Merge({Half("1"), Half("2")}, folder / "merged");
  ASSERT_EQ(merged.exit_code, 0) << merged.err;
  EXPECT_EQ(List(folder / "merged"), List(Whole()));
  EXPECT_EQ(RunCommand({Binary("evac"), "report", (folder / "merged").string()}).exit_code, 0);
  const Store store = Store::Open(folder / "merged", Store::Mode::kReadOnly),
              whole = Store::Open(Whole(), Store::Mode::kReadOnly);
  EXPECT_EQ(store.InitialScenes(), whole.InitialScenes());
  for (Episode episode : store.Episodes()) {
    EXPECT_TRUE(fs::exists(folder / "merged" / episode.video));
    EXPECT_TRUE(fs::exists(folder / "merged" / episode.thumbnail));
    EXPECT_EQ(store.LoadPrivileged(episode.key.Id()).size(), whole.LoadPrivileged(episode.key.Id()).size());
  }
  const CommandResult goes_on = RunCommand({Binary("evac"), "resume", (folder / "merged").string()});
  EXPECT_EQ(goes_on.exit_code, 0) << goes_on.err;
}

/// Half a run, and what was merged from it alone, were whole to merge and report.
TEST(Merge, AHalfIsNoWholeRun) {
  const TempFolder folder;
  const CommandResult half = Merge({Half("1")}, folder / "half");
  const CommandResult whole = Merge({Half("1"), Half("2")}, folder / "whole");
  EXPECT_EQ(half.exit_code, 0) << half.err;
  EXPECT_THAT(half.err, HasSubstr("of the suite's 5 episodes are there"));
  EXPECT_EQ(whole.err.find("are there"), std::string::npos) << whole.err;
  EXPECT_EQ(Store::Open(folder / "half", Store::Mode::kReadOnly).PageHashes().count("take_bottle"), 1u);
  const auto summary = [](const fs::path& run) {
    const CommandResult report = RunCommand({Binary("evac"), "report", run.string()});
    EXPECT_EQ(report.exit_code, 0) << report.err;
    return ReadFile(run / "report/summary.md");
  };
  EXPECT_THAT(summary(folder / "half"), HasSubstr("of 5 episodes of the suite are there"));
  EXPECT_THAT(summary(folder / "whole"), HasSubstr("All 5 episodes ran to their end"));
}

TEST(Merge, DuplicatesThatAgreeAreTakenOnceAndNothingIsOverwritten) {
  const TempFolder folder;
  const CommandResult merged = Merge({Half("1"), Whole()}, folder / "merged");
  ASSERT_EQ(merged.exit_code, 0) << merged.err;
  EXPECT_EQ(List(folder / "merged"), List(Whole()));
  EXPECT_EQ(Merge({Half("1")}, folder / "merged").exit_code, 2);
  EXPECT_EQ(Merge({Half("1"), folder / "nothing"}, folder / "again").exit_code, 2);
  EXPECT_FALSE(fs::exists(folder / "again"));
}

TEST(Merge, RunsOfAnotherSuiteAreRefused) {
  const TempFolder folder;
  ASSERT_EQ(RunCommand(RunWords(kFaults, folder / "other", {"initial_states.count=1"})).exit_code, 0);
  const CommandResult merged = Merge({Half("1"), folder / "other"}, folder / "merged");
  EXPECT_EQ(merged.exit_code, 2);
  EXPECT_THAT(merged.err, AllOf(HasSubstr("different suites"), HasSubstr((folder / "other").string())));
  EXPECT_FALSE(fs::exists(folder / "merged"));
}

/// A run of the same suite whose episodes came out otherwise.
void AddOther(const fs::path& from, const fs::path& to, bool as_failure) {
  const Store whole = Store::Open(from, Store::Mode::kReadOnly);
  Store other = Store::CreateOrContinue(to, whole.run());
  for (const Task& task : whole.Tasks()) other.AddTask(task);
  for (const WorldInfo& world : whole.Worlds()) other.AddWorld(world);
  for (const PolicyInfo& policy : whole.Policies()) other.AddPolicy(policy);
  Episode episode = whole.Episodes().at(1);
  episode.video = episode.video_sha256 = episode.thumbnail = "";
  episode.stop = as_failure ? StopReason::kPolicyError : StopReason::kMaxChunks;
  episode.failure = as_failure ? "it broke" : "";
  other.Add({.episode = episode, .privileged = {}, .video = {}, .thumbnail_jpeg = {}});
}

TEST(Merge, DuplicatesThatDisagreeAreNamedAndAFailedOneYields) {
  const TempFolder folder;
  AddOther(Whole(), folder / "other", false);
  const CommandResult refused = Merge({Whole(), folder / "other"}, folder / "merged");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("real/take_bottle/faulty@default/3-0001-s1 in "),
                                 HasSubstr((folder / "other").string())));
  EXPECT_FALSE(fs::exists(folder / "merged"));

  AddOther(Whole(), folder / "failed", true);
  ASSERT_EQ(Merge({folder / "failed", Whole()}, folder / "merged").exit_code, 0);
  EXPECT_EQ(List(folder / "merged"), List(Whole()));
}

TEST(Merge, AVideoThatIsNotTheStoredOneIsRefused) {
  const TempFolder folder;
  fs::copy(Half("1"), folder / "spoiled", fs::copy_options::recursive);
  const std::string video = Store::Open(folder / "spoiled", Store::Mode::kReadOnly).Episodes().at(0).video;
  WriteText(folder / "spoiled" / video, "other bytes");
  const CommandResult merged = Merge({folder / "spoiled"}, folder / "merged");
  EXPECT_EQ(merged.exit_code, 2);
  EXPECT_THAT(merged.err, HasSubstr(video));
  EXPECT_FALSE(fs::exists(folder / "merged"));
}

TEST(Merge, WhoRunsOneShardRetriesAndCountsItsFailedEpisodesAlone) {
  const TempFolder folder;
  WriteText(folder / "sick", "yes");
  const std::string sick = "policies.0.command=[faulty-policy, --fault, error, --while, " + (folder / "sick").string() + "]";
  const fs::path run = folder / "run";
  ASSERT_EQ(RunCommand(RunWords(kFaults, run, {sick, "initial_states.count=5"})).exit_code, 0) << "all of them may fail";
  const auto failed = [&] {
    int count = 0;
    for (const Episode& episode : Store::Open(run, Store::Mode::kReadOnly).Episodes()) count += IsFailure(episode.stop);
    return count;
  };
  ASSERT_EQ(failed(), 5);
  fs::remove(folder / "sick");
  const CommandResult half = RunCommand({Binary("evac"), "resume", run.string(), "--retry-failed", "--shard", "1/2"});
  EXPECT_EQ(half.exit_code, 0) << half.err;
  EXPECT_THAT(half.err, HasSubstr("2 of 2 episodes stored in " + run.string() + ", 0 failed"));
  EXPECT_EQ(failed(), 3) << "the other shard's are another machine's";
}

TEST(Merge, WhoRunsOneShardIsToldToGoOnWithThatShard) {
  const TempFolder folder;
  const CommandResult spent =
      RunShard(folder / "run", "2/2", {"policies.0.command=[faulty-policy, --fault, error]", "error_budget=0"});
  EXPECT_EQ(spent.exit_code, 4);
  EXPECT_THAT(spent.err, HasSubstr("evac resume " + (folder / "run").string() + " --retry-failed --shard 2/2"));
}

TEST(Merge, AShardIsWhichOfHowMany) {
  const TempFolder folder;
  for (const char* shard : {"3/2", "0/2", "half", "1/2x"})
    EXPECT_EQ(RunShard(folder / "run", shard).exit_code, 2) << shard;
}

/// 4294967297 of 4294967298 passed as 1 of 2.
TEST(Merge, AShardsNumbersThatFitNoIntAreRefused) {
  const TempFolder folder;
  for (const char* shard : {"4294967297/4294967298", "1/4294967298", "1/99999999999999999999"}) {
    const CommandResult result = RunShard(folder / "run", shard);
    EXPECT_EQ(result.exit_code, 2) << shard;
    EXPECT_THAT(result.err, HasSubstr("wanted which of how many, such as 2/4"));
  }
  EXPECT_FALSE(fs::exists(folder / "run"));
}

}  // namespace
}  // namespace evac
