#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

#include "core/file.h"
#include "core/hash.h"
#include "core/store_study.h"
#include "core/video.h"
#include "tests/reports/stored_run.h"
#include "tests/support/command.h"
#include "worldmodel/evac_config.h"
#include "worldmodel/nn/weights.h"

/// `evac rate` as a lab runs it, and the page in real browsers: the scripts in tests/system/browser say what is tried.
namespace evac::system_test {
namespace {

using testing::HasSubstr;

constexpr int kSkipped = 77;

CommandResult Rate(std::vector<std::string> words) {
  words.insert(words.begin(), {Binary("evac"), "rate"});
  return RunCommand(words);
}

TEST(RatingSession, PeopleRateInRealBrowsersAndNothingIsLost) {
  const StoredRun run("session", "sfsfsfsfsfsfsfsfsfsf", "sffssffssffssffssffs", 10);
  const std::string study = (run.folder().parent_path() / "study").string();
  const CommandResult made =
      Rate({"new", study, "--run", run.folder().string(), "--gold-from", "oracle", "--height", "96"});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const StudyStore store = StudyStore::Open(study, StudyStore::Mode::kReadOnly);
  for (const StudyClip& clip : store.Clips()) {  // one that no browser plays
    if (clip.use != Showing::kCounted) continue;
    const std::filesystem::path file = std::filesystem::path(study) / clip.file;
    const auto size = std::filesystem::file_size(file);
    std::ofstream(file, std::ios::binary) << std::string(size, 'x');
    break;
  }
  std::vector<std::string> words = {"/usr/bin/python3", "-B", EVAC_SOURCE_DIR "/tests/system/browser/rating_page.py",
                                    Binary("evac"), study};
  if (const char* screenshots = std::getenv("EVAC_SCREENSHOTS")) words.push_back(screenshots);
  const CommandResult rated = RunCommand(words);
  if (rated.exit_code == kSkipped) GTEST_SKIP() << rated.out;
  EXPECT_EQ(rated.exit_code, 0) << rated.err << rated.out;  // what failed comes first: logs get cut
  EXPECT_THAT(rated.out, HasSubstr("0 failed"));
}

TEST(RatingSession, TwoStudiesOnOneHostLoseNothingOfARaterOfBoth) {
  const StoredRun run("shared", "sfsfsf", "sffsff", 10);
  const std::string study = (run.folder().parent_path() / "study").string(), other = study + "_other";
  for (const std::string& folder : {study, other})
    ASSERT_EQ(Rate({"new", folder, "--run", run.folder().string(), "--height", "96"}).exit_code, 0);
  const CommandResult rated = RunCommand(
      {"/usr/bin/python3", "-B", EVAC_SOURCE_DIR "/tests/system/browser/two_studies.py", Binary("evac"), study, other});
  if (rated.exit_code == kSkipped) GTEST_SKIP() << rated.out;
  EXPECT_EQ(rated.exit_code, 0) << rated.err << rated.out;
  EXPECT_THAT(rated.out, HasSubstr("0 failed"));
}

TEST(RatingSession, ASheetComesInAndLabelsGoBackIntoTheRun) {
  StoredRun run("sheet", "sffs", "ssff");
  { const Store closed = std::move(run.store()); }  // `evac rate resolve` writes into the run
  const std::string study = (run.folder().parent_path() / "study").string();
  ASSERT_EQ(Rate({"new", study, "--run", run.folder().string(), "--raters", "3", "--height", "64"}).exit_code, 0);
  const std::string good = (run.folder().parent_path() / "good.csv").string(), bad = good + ".bad";
  std::ofstream(good)
      << "episode,rater,label,note\n"
         "real/take/pick@1/41-0000-s1,ann,success,\"clean, quick\"\nreal/take/pick@1/41-0000-s1,bob,S,\n"
         "real/take/pick@1/41-0001-s1,ann,F,\nreal/take/pick@1/41-0001-s1,bob,success,\nreal/take/pick@1/"
         "41-0001-s1,cleo,0,\n"
         "sim/take/pick@1/41-0002-s1,ann,success,\nsim/take/pick@1/41-0002-s1,bob,failure,\n";
  std::ofstream(bad) << "episode,rater,label\nreal/take/pick@1/41-0000-s1,ann,maybe\nreal/take/none,ann,success\nreal/"
                        "take/pick@1/41-0001-s1,,success\n";
  const CommandResult refused = Rate({"import", study, bad});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr(".bad:2: label: found"));
  EXPECT_THAT(refused.err, HasSubstr(".bad:3: episode:"));
  EXPECT_THAT(refused.err, HasSubstr(".bad:4: rater:"));
  const CommandResult imported = Rate({"import", study, good});
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  EXPECT_THAT(imported.out, HasSubstr("7 verdicts, 7 new"));
  EXPECT_THAT(Rate({"import", study, good}).out, HasSubstr("7 verdicts, 0 new"));
  const CommandResult resolved = Rate({"resolve", study});
  EXPECT_EQ(resolved.exit_code, 0) << resolved.err;
  EXPECT_THAT(resolved.out, HasSubstr("human: 2 clips decided, 1 not; 3 new verdicts"));
  EXPECT_THAT(Rate({"resolve", study}).out, HasSubstr("0 new verdicts"));
  const CommandResult listed = RunCommand({Binary("evac"), "ls", run.folder().string()});
  EXPECT_THAT(listed.out, HasSubstr("human=success oracle=success"));
  EXPECT_THAT(listed.out, HasSubstr("human=cannot_tell"));
  const CommandResult calibrated = RunCommand(
      {Binary("evac"), "judge", "calibrate", run.folder().string(), "--judge", "oracle", "--against", "human"});
  EXPECT_EQ(calibrated.exit_code, 3) << calibrated.err << "two clips are too few to say";
  const auto lines = Rate({"export", study, "--jsonl", "-"}).out;
  EXPECT_EQ(nlohmann::json::parse(lines.substr(0, lines.find('\n'))).at("note"), "clean, quick");
}

/// They came in without a word, and no rate had them.
TEST(RatingSession, ASheetOfAllClipsComesInWholeAndIsToldWhichOfItCountNowhere) {
  const StoredRun run("whole", "sfsf", "sffs");
  const std::string study = (run.folder().parent_path() / "study").string(), sheet = study + ".csv";
  const std::vector<std::string> made = {"new", study, "--run", run.folder().string(), "--gold-from", "oracle"};
  ASSERT_EQ(Rate(made).exit_code, 0);
  std::ofstream written(sheet);
  written << "episode,rater,label\n";
  int uncounted = 0;
  for (const StudyClip& clip : StudyStore::Open(study, StudyStore::Mode::kReadOnly).Clips()) {
    written << clip.episode << ",ann,success\n";
    uncounted += clip.use == Showing::kExample || clip.use == Showing::kPractice ? 1 : 0;
  }
  written.close();
  ASSERT_EQ(uncounted, 4);
  const CommandResult imported = Rate({"import", study, sheet});
  ASSERT_EQ(imported.exit_code, 0) << imported.err;
  EXPECT_THAT(imported.out, HasSubstr("8 verdicts, 8 new\nnote: 4 of them are of examples and practice clips"));
  EXPECT_EQ(nlohmann::json::parse(Rate({"status", study, "--json"}).out).at("progress").at("votes"), 4);
}

/// They were "not judged yet" for ever, and the command that was named against it was refused.
TEST(RatingSession, OfWhichClipsThereIsNoLabelIsSaidWhenTheOthersGetTheirs) {
  StoredRun run("unlabelled", "sfsf", "sffs");
  { const Store closed = std::move(run.store()); }  // `evac rate resolve` writes into the run
  const std::string folder = run.folder().string(), study = (run.folder().parent_path() / "study").string();
  ASSERT_EQ(Rate({"new", study, "--run", folder, "--gold-from", "oracle", "--height", "64"}).exit_code, 0);
  std::ofstream sheet(study + ".csv");
  sheet << "episode,rater,label\n";
  for (const StudyClip& clip : StudyStore::Open(study, StudyStore::Mode::kReadOnly).Clips())
    sheet << clip.episode << ",ann,success\n" << clip.episode << ",bob,success\n";
  sheet.close();
  ASSERT_EQ(Rate({"import", study, study + ".csv"}).exit_code, 0);
  const CommandResult resolved = Rate({"resolve", study});
  EXPECT_EQ(resolved.exit_code, 0) << resolved.err;
  EXPECT_THAT(resolved.out, HasSubstr("human: 4 clips decided, 0 not; 4 new verdicts in their runs\n"
                                      "note: 4 of the study's clips are examples and practice: they get no label"));
  ASSERT_EQ(RunCommand({Binary("evac"), "report", folder, "--judge", "human"}).exit_code, 0);
  EXPECT_THAT(ReadFile(folder + "/report/index.html"),
              HasSubstr("adds them. But a study's examples and practice clips get no label."));
}

/// A run was the text that the study has for it, which nobody typed: "out/run/" had no clip.
TEST(RatingSession, ASheetMayNameARunInAnyWayThatNamesItsFolder) {
  const StoredRun one("one", "s", "s"), two("two", "s", "s");
  const std::string study = (one.folder().parent_path() / "study").string(), sheet = study + ".csv";
  const CommandResult made =
      Rate({"new", "--height", "64", "--run", one.folder().string(), "--run", two.folder().string(), study});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto import_votes = [&](const std::string& first, const std::string& second) {
    std::ofstream(sheet) << "episode,run,rater,label\nreal/take/pick@1/41-0000-s1," << first
                         << ",ann,success\nreal/take/pick@1/41-0000-s1," << second << ",ann,failure\n";
    return Rate({"import", study, sheet});
  };
  const std::string there = two.folder().parent_path().string();
  const CommandResult other = import_votes(one.folder().string(), there + "/other");
  EXPECT_EQ(other.exit_code, 2) << other.out;
  EXPECT_THAT(other.err, HasSubstr("has no clip"));
  const CommandResult imported = import_votes(one.folder().string() + "/", there + "/./two");
  EXPECT_EQ(imported.exit_code, 0) << imported.err;
  EXPECT_THAT(imported.out, HasSubstr("2 verdicts, 2 new"));
}

TEST(RatingSession, ClipsThatWereNotImaginedAreShownAsTheWorldModelsCodecGivesThemBackIfAskedFor) {
  const StoredRun run("soft", "sf", "fs");
  const auto beside = [&](const char* name) { return (run.folder().parent_path() / name).string(); };
  const std::string weights = beside("small.safetensors"), config = EVAC_SOURCE_DIR "/tests/system/evac_small.yaml";
  nn::RandomWeights random(5);
  nn::SaveWeights(weights, random, ReadEvacConfig(config));
  ASSERT_EQ(Rate({"new", beside("crisp"), "--run", run.folder().string(), "--height", "64"}).exit_code, 0);
  const CommandResult made = Rate({"new", beside("soft_study"), "--run", run.folder().string(), "--height", "64",
                                   "--vae-roundtrip", weights, "--config", config});
  ASSERT_EQ(made.exit_code, 0) << made.err;
  const auto first = [&](const char* name) {
    const StudyStore study = StudyStore::Open(beside(name), StudyStore::Mode::kReadOnly);
    return ReadAllFrames(std::filesystem::path(beside(name)) / study.Clips().front().file).front();
  };
  const cv::Mat crisp = first("crisp"), soft = first("soft_study");
  ASSERT_EQ(crisp.size(), soft.size());
  EXPECT_GT(cv::norm(crisp, soft, cv::NORM_L1) / static_cast<double>(crisp.total() * 3), 5)
      << "random weights show something else";
  EXPECT_EQ(StudyStore::Open(beside("soft_study"), StudyStore::Mode::kReadOnly).Codec(), Sha256HexOfFile(weights));
  EXPECT_EQ(Rate({"new", beside("half"), "--run", run.folder().string(), "--vae-roundtrip", weights}).exit_code, 2);
  const CommandResult other =
      Rate({"new", beside("other"), "--run", run.folder().string(), "--vae-roundtrip", config, "--config", config});
  EXPECT_EQ(other.exit_code, 2) << other.err;
  EXPECT_FALSE(std::filesystem::exists(beside("other"))) << "nothing is left half-made";
}

TEST(RatingSession, VerdictsByTwoRubricsAreInOneRateOnlyWhenAskedFor) {
  StoredRun before("before", "ss", "ss", 4, "v1"), after("after", "", "", 4, "v2");
  after.Add("42-0000", 's', 's');
  { const Store closed = std::move(before.store()), too = std::move(after.store()); }
  const std::string study = (before.folder().parent_path() / "study").string(), sheet = study + ".csv";
  const auto import_votes_of = [&](const std::string& state) {
    std::ofstream(sheet) << "episode,rater,label\nreal/take/pick@1/" << state << "-s1,ann,success\nreal/take/pick@1/"
                         << state << "-s1,bob,success\n";
    return Rate({"import", study, sheet}).exit_code;
  };
  for (const StoredRun* run : {&before, &after})
    ASSERT_EQ(Rate({"new", study, "--run", run->folder().string(), "--height", "64"}).exit_code, 0);
  ASSERT_EQ(import_votes_of("41-0000"), 0);
  EXPECT_EQ(Rate({"resolve", study}).exit_code, 0) << "one rubric alone was voted by";
  ASSERT_EQ(import_votes_of("42-0000"), 0);
  const CommandResult refused = Rate({"resolve", study});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("task take: was rated by 2 rubrics; --mix-rubrics"));
  EXPECT_EQ(Rate({"resolve", study, "--mix-rubrics"}).exit_code, 0);
  const auto rates = nlohmann::json::parse(Rate({"status", study, "--json"}).out).at("rates");
  ASSERT_EQ(rates.size(), 4u) << "two worlds, two rubrics";
  EXPECT_EQ(rates[0].at("rubric"), "v1");
  EXPECT_EQ(rates[0].at("clips"), 2);
  EXPECT_EQ(rates[1].at("rubric"), "v2");
}

TEST(RatingSession, WrongWordsAreRefusedWithWhatWasWanted) {
  const StoredRun run("refused", "s", "f");
  const std::string study = (run.folder().parent_path() / "study").string();
  EXPECT_EQ(Rate({"serve", study}).exit_code, 2);
  EXPECT_THAT(Rate({"status", study}).err, HasSubstr("there is no study"));
  EXPECT_EQ(Rate({"new", study, "--run", study}).exit_code, 2);
  ASSERT_EQ(Rate({"new", study, "--run", run.folder().string(), "--height", "64"}).exit_code, 0);
  EXPECT_THAT(Rate({"new", study, "--run", run.folder().string()}).err,
              HasSubstr("every clip of these runs is in it already"));
  EXPECT_THAT(Rate({"new", study, "--run", run.folder().string(), "--raters", "5"}).err,
              HasSubstr("--raters: found 5, but " + study + " was begun with 3"));
  EXPECT_THAT(Rate({"new", study, "--run", run.folder().string(), "--name", "other"}).err,
              HasSubstr("--name: found 'other'"));
  const CommandResult higher = Rate({"new", study, "--run", run.folder().string(), "--height", "96"});
  EXPECT_EQ(higher.exit_code, 2);
  EXPECT_THAT(higher.err, HasSubstr("--height: found 96, but " + study + " was begun with 64"));
  const std::string unknown = study + "_unknown";
  EXPECT_THAT(Rate({"new", unknown, "--run", run.folder().string(), "--gold-from", "orakel"}).err,
              HasSubstr("--gold-from: found 'orakel', wanted one who has judged these runs: oracle"));
  EXPECT_FALSE(std::filesystem::exists(unknown)) << "no study is frozen without the gold that was asked for";
  EXPECT_THAT(Rate({"invite", study, "--role", "king"}).err, HasSubstr("wanted rater, adjudicator or lead"));
  EXPECT_THAT(Rate({"export", study}).err, HasSubstr("--csv"));
  const std::string table = study + "_tables/new/verdicts.csv";
  const CommandResult exported = Rate({"export", study, "--csv", table});
  EXPECT_EQ(exported.exit_code, 0) << exported.err;
  EXPECT_THAT(ReadFile(table), HasSubstr(",")) << "with the folders above it";
  const CommandResult over_a_folder = Rate({"export", study, "--csv", study});
  EXPECT_EQ(over_a_folder.exit_code, 2) << over_a_folder.err;
  EXPECT_THAT(over_a_folder.err, HasSubstr(study + ": is a folder, wanted a file"));
  EXPECT_THAT(Rate({"invite", study, "--count", "2", "--url", "https://rate.lab.org"}).out,
              testing::MatchesRegex("(https://rate.lab.org/r/[0-9a-f]+\n)+"));
}

}  // namespace
}  // namespace evac::system_test
