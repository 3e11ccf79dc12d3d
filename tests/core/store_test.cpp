#include "core/store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <thread>

#include "core/error.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/store_schema.h"
#include "core/store_sqlite.h"
#include "tests/core/store_samples.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using namespace samples;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::UnorderedElementsAre;

bool SameBits(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  return std::memcmp(a.matrix().topRows<3>().eval().data(), b.matrix().topRows<3>().eval().data(),
                     12 * sizeof(double)) == 0;
}

bool SameBits(const Arms& a, const Arms& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const ArmState& x, const ArmState& y) {
    return SameBits(x.base_from_gripper, y.base_from_gripper) &&
           std::memcmp(&x.closure, &y.closure, sizeof(double)) == 0;
  });
}

template <typename Call>
std::string MessageOf(const Call& call, ExitCode expected = ExitCode::kInvalidInput) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), expected) << error.what();
    return error.what();
  }
  return "no error";
}

std::vector<std::string> FilesBelow(const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) names.push_back(entry.path().lexically_relative(folder).string());
  }
  return names;
}

class StoreTest : public testing::Test {
 protected:
  Store NewRun() {
    Store store = Store::CreateOrContinue(run_, SomeRun());
    Declare(store);
    return store;
  }
  sqlite::Connection Raw() const { return sqlite::Connection::OpenReadWrite(run_ / "evac.sqlite"); }

  const TempFolder folder_;
  const std::filesystem::path run_ = folder_ / "out/run #1?";
};

TEST_F(StoreTest, AnEpisodeComesBackAsItWasAdded) {
  Store store = NewRun();
  const EpisodeRecord record = SomeEpisode(store, Key(3));
  store.Add(record);
  ASSERT_EQ(store.Episodes().size(), 1u);
  Episode episode = store.Episodes()[0];
  EXPECT_EQ(episode.key, Key(3));
  EXPECT_EQ(episode.chunks, 2);
  EXPECT_EQ(episode.stop, StopReason::kStill);
  EXPECT_EQ(episode.stop_reason, record.episode.stop_reason);
  EXPECT_EQ(episode.failure, "");
  EXPECT_EQ(episode.video, "videos/sim/take_bottle/visual_pick@good/41-0007-s3.mp4");
  EXPECT_EQ(episode.video_sha256, Sha256HexOfFile(run_ / episode.video));
  EXPECT_EQ(ReadFile(run_ / episode.thumbnail), record.thumbnail_jpeg);
  EXPECT_THAT(episode.observations, IsEmpty());

  store.LoadSteps(episode);
  ASSERT_EQ(episode.observations.size(), 5u);
  ASSERT_EQ(episode.commands.size(), 4u);
  for (std::size_t i = 0; i < 5; ++i) {
    EXPECT_TRUE(SameBits(episode.observations[i].arms, record.episode.observations[i].arms));
    EXPECT_EQ(episode.observations[i].arms_are_commanded, i == 3);
    EXPECT_THAT(episode.observations[i].images, IsEmpty());
  }
  for (std::size_t i = 0; i < 4; ++i) EXPECT_TRUE(SameBits(episode.commands[i], record.episode.commands[i]));
}

TEST_F(StoreTest, PrivilegedFramesComeBackToTheLastBit) {
  Store store = NewRun();
  const EpisodeRecord record = SomeEpisode(store, Key(3));
  store.Add(record);
  const PrivilegedTrack track = store.LoadPrivileged(Key(3).Id());
  ASSERT_EQ(track.size(), 5u);
  for (std::size_t i = 0; i < 5; ++i) {
    ASSERT_EQ(track[i].bodies.size(), 2u);
    for (int body = 0; body < 2; ++body) {
      EXPECT_EQ(track[i].bodies[body].name, record.privileged[i].bodies[body].name);
      EXPECT_TRUE(SameBits(track[i].bodies[body].base_from_body, record.privileged[i].bodies[body].base_from_body));
    }
    ASSERT_EQ(track[i].contacts.size(), 1u);
    EXPECT_EQ(track[i].contacts[0].a + track[i].contacts[0].b, "bottlehand");
    EXPECT_EQ(track[i].contacts[0].force_n, record.privileged[i].contacts[0].force_n);
  }
  EXPECT_THAT(store.LoadPrivileged("no such episode"), IsEmpty());
}

TEST_F(StoreTest, AnEpisodeWithoutFramesHasARowAndNoFiles) {
  Store store = NewRun();
  EpisodeRecord record;
  record.episode = {.key = Key(1),
                    .observations = {},
                    .commands = {},
                    .stop = StopReason::kWorldError,
                    .stop_reason = "after 0 chunks: no scene",
                    .failure = "no scene",
                    .video = "",
                    .video_sha256 = "",
                    .thumbnail = ""};
  store.Add(record);
  Episode episode = store.Episodes().at(0);
  EXPECT_EQ(episode.failure, "no scene");
  EXPECT_EQ(episode.video + episode.video_sha256 + episode.thumbnail, "");
  store.LoadSteps(episode);
  EXPECT_THAT(episode.observations, IsEmpty());
}

TEST_F(StoreTest, EpisodesStandInPairKeyOrderAndThenByWorldWhateverTheOrderOfFinishing) {
  Store store = NewRun();
  store.AddPolicy({"hold", "a", "{}"});
  EpisodeKey largest = Key(0), other = Key(9);
  largest.pair.seed = ~std::uint64_t{0};
  other.pair.policy = "hold";
  other.pair.checkpoint = "a";
  for (const EpisodeKey& key : {largest, Key(10, "sim"), Key(2, "sim"), Key(10, "real"), other})
    store.Add(SomeEpisode(store, key));
  std::vector<EpisodeKey> keys;
  for (const Episode& episode : store.Episodes()) keys.push_back(episode.key);
  EXPECT_THAT(keys, ElementsAre(other, Key(2, "sim"), Key(10, "real"), Key(10, "sim"), largest));
}

TEST_F(StoreTest, TheSameEpisodeIsNotAddedTwiceAndItsFilesStay) {
  Store store = NewRun();
  store.Add(SomeEpisode(store, Key(1)));
  EXPECT_TRUE(store.Has(Key(1)));
  EXPECT_FALSE(store.Has(Key(1, "real")));
  EpisodeRecord again = SomeEpisode(store, Key(1));
  again.thumbnail_jpeg = "another";
  EXPECT_THAT(MessageOf([&] { store.Add(again); }, ExitCode::kInternal), HasSubstr(Key(1).Id()));
  EXPECT_EQ(ReadFile(run_ / store.Episodes().at(0).thumbnail), "jpeg of " + Key(1).Id());
}

TEST_F(StoreTest, ManyEpisodesAreAddedTogetherOrNotAtAll) {
  Store store = NewRun();
  std::vector<EpisodeRecord> records = {SomeEpisode(store, Key(1)), SomeEpisode(store, Key(2)), SomeEpisode(store, Key(1))};
  EXPECT_THAT(MessageOf([&] { store.AddAll(records); }, ExitCode::kInternal), HasSubstr(Key(1).Id()));
  EXPECT_TRUE(store.Episodes().empty());
  records.pop_back();
  store.AddAll(records);
  ASSERT_EQ(store.Episodes().size(), 2u);
  Episode second = store.Episodes().at(1);
  store.LoadSteps(second);
  EXPECT_EQ(second.commands.size(), records[1].episode.commands.size());
  EXPECT_EQ(store.LoadPrivileged(second.key.Id()).size(), records[1].privileged.size());
}

TEST_F(StoreTest, AVideoOutsideTheFolderIsRefused) {
  Store store = NewRun();
  EpisodeRecord record = SomeEpisode(store, Key(1));
  std::filesystem::copy_file(record.video->path, folder_ / "elsewhere.mp4");
  for (const std::filesystem::path& path :
       {folder_ / "elsewhere.mp4", run_ / "../../elsewhere.mp4", run_ / "videos/none.mp4"}) {
    record.video->path = path;
    EXPECT_THAT(MessageOf([&] { store.Add(record); }, ExitCode::kInternal), HasSubstr(path.filename().string()));
  }
  EXPECT_FALSE(store.Has(Key(1)));
}

TEST_F(StoreTest, NamesThatWouldLeadOutOfTheFolderAreRefused) {
  const Store store = NewRun();
  EpisodeKey key = Key(1);
  key.world = "../../..";
  EXPECT_THAT(MessageOf([&] { store.VideoPath(key); }), HasSubstr("../../.."));
}

TEST_F(StoreTest, AnEpisodeOfWhatWasNeverDeclaredIsRefusedByName) {
  Store store = NewRun();
  EpisodeKey key = Key(1);
  key.world = "dream";
  EXPECT_THAT(MessageOf([&] { store.Add(SomeEpisode(store, key)); }, ExitCode::kInternal), HasSubstr("world 'dream'"));
  key = Key(1);
  key.pair.checkpoint = "best";
  EXPECT_THAT(MessageOf([&] { store.Add(SomeEpisode(store, key)); }, ExitCode::kInternal),
              HasSubstr("visual_pick@best"));
}

TEST_F(StoreTest, ATaskComesBackWholeAndIsNotChanged) {
  Store store = NewRun();
  Task task = SomeTask();
  task.page = "mujoco:   {scene: a.xml}   # another layout\nid: take_bottle\n";
  task.page_path = "/moved/take_bottle.yaml";
  store.AddTask(task);  // means the same
  const Task stored = store.Tasks().at(0);
  EXPECT_EQ(stored.page, SomeTask().page);
  EXPECT_EQ(stored.page_path, SomeTask().page_path);
  EXPECT_EQ(stored.instruction, task.instruction);
  EXPECT_EQ(stored.cameras.at(1).mount, Mount::kRightGripper);
  EXPECT_EQ(stored.cameras.at(1).fx_px, task.cameras[1].fx_px);
  EXPECT_TRUE(SameBits(stored.cameras.at(1).mount_from_camera, task.cameras[1].mount_from_camera));
  EXPECT_EQ(stored.still.translation_m, 1.0 / 3);
  EXPECT_EQ(stored.workspace_m.max(), task.workspace_m.max());
  EXPECT_EQ(stored.rubric.stages.at(0).all_of.at(0).below, 0.05);
  EXPECT_EQ(stored.rubric.stages.at(0).all_of.at(0).above, std::nullopt);
  EXPECT_EQ(stored.rubric.stages.at(0).at_end, true);

  task.max_chunks = 26;
  EXPECT_THAT(MessageOf([&] { store.AddTask(task); }),
              AllOf(HasSubstr("take_bottle"), HasSubstr("25"), HasSubstr("26")));
  Task other_page = SomeTask();
  other_page.page = "id: take_bottle\nmujoco: {scene: b.xml}\n";
  EXPECT_THAT(MessageOf([&] { store.AddTask(other_page); }), HasSubstr("b.xml"));
  Task infinite = SomeTask("infinite");
  infinite.workspace_m.max().x() = std::numeric_limits<double>::infinity();
  EXPECT_THAT(MessageOf([&] { store.AddTask(infinite); }), HasSubstr("infinite"));
  EXPECT_EQ(store.Tasks().size(), 1u);
}

TEST_F(StoreTest, WorldsAndPoliciesAreDeclaredOnceAndOtherwiseRefused) {
  Store store = NewRun();
  Declare(store);
  EXPECT_EQ(store.Worlds().size(), 2u);
  EXPECT_TRUE(store.Worlds().at(0).is_real);
  EXPECT_EQ(store.Policies().at(0).declaration, R"({"arms": 1})");
  EXPECT_THAT(
      MessageOf([&] { store.AddWorld({.name = "real", .type = "mujoco", .is_real = true, .profile_hash = "f01"}); }),
      AllOf(HasSubstr("f00"), HasSubstr("f01")));
  EXPECT_THAT(MessageOf([&] { store.AddPolicy({"visual_pick", "good", "{}"}); }), HasSubstr("visual_pick@good"));
}

TEST_F(StoreTest, AnInitialSceneComesBackExactlyAndIsTheLowestSeedsWhateverTheOrder) {
  SplitMix64 random(5);
  const auto scene = [&](int seed) {
    return InitialScene{{Image(seed), Image(seed + 100, 7, 5)}, SomeArms(random, 2), SomeTask().cameras};
  };
  const InitialScene first = scene(1), second = scene(2), third = scene(3);
  for (const std::vector<int>& order : std::vector<std::vector<int>>{{1, 2, 3}, {3, 2, 1}, {2, 1, 3}}) {
    Store store = Store::InMemory(folder_ / "m", SomeRun());
    Declare(store);
    EXPECT_FALSE(store.LoadInitialScene("take_bottle", "41-0007"));
    for (const int seed : order) store.AddInitialScene(Key(seed).pair, seed == 1 ? first : seed == 2 ? second : third);
    const std::optional<InitialScene> loaded = store.LoadInitialScene("take_bottle", "41-0007");
    ASSERT_TRUE(loaded);
    ASSERT_EQ(loaded->images.size(), 2u);
    for (int i = 0; i < 2; ++i) EXPECT_EQ(cv::norm(loaded->images[i], first.images[i], cv::NORM_INF), 0);
    EXPECT_TRUE(SameBits(loaded->arms, first.arms));
    ASSERT_EQ(loaded->cameras.size(), 2u);
    EXPECT_EQ(loaded->cameras[0].cy_px, first.cameras[0].cy_px);
    EXPECT_TRUE(SameBits(loaded->cameras[1].mount_from_camera, first.cameras[1].mount_from_camera));
  }
}

Verdict SomeVerdict(const std::string& judge, Label label) {
  return {.episode_id = Key(1).Id(),
          .judge = judge,
          .label = label,
          .probability = 0.25,
          .stages = {{"reach", true}, {"lift", false}},
          .reason = "never lifted",
          .rubric_version = "r1"};
}

TEST_F(StoreTest, EveryVerdictIsKeptAndTheLastOfAJudgeIsCurrent) {
  Store store = NewRun();
  store.Add(SomeEpisode(store, Key(1)));
  store.AddVerdict(SomeVerdict("oracle", Label::kFailure));
  store.AddVerdict(SomeVerdict("human:ann", Label::kCannotTell));
  store.AddVerdict(SomeVerdict("oracle", Label::kSuccess));
  ASSERT_EQ(store.Verdicts().size(), 3u);
  EXPECT_EQ(store.Verdicts()[0].label, Label::kFailure);
  const auto current = store.CurrentVerdicts().at(Key(1).Id());
  EXPECT_EQ(current.at("human:ann").label, Label::kCannotTell);
  const Verdict& oracle = current.at("oracle");
  EXPECT_EQ(oracle.label, Label::kSuccess);
  EXPECT_EQ(oracle.probability, 0.25);
  EXPECT_EQ(oracle.stages, (std::map<std::string, bool>{{"reach", true}, {"lift", false}}));
  EXPECT_EQ(oracle.reason + oracle.rubric_version, "never liftedr1");
  Verdict stray = SomeVerdict("oracle", Label::kSuccess);
  stray.episode_id = "nobody's";
  EXPECT_THAT(MessageOf([&] { store.AddVerdict(stray); }), HasSubstr("nobody's"));
}

TEST_F(StoreTest, VerdictsAndEpisodesAreAppendOnlyEvenForSql) {
  {
    Store store = NewRun();
    store.Add(SomeEpisode(store, Key(1)));
    store.AddVerdict(SomeVerdict("oracle", Label::kFailure));
  }
  sqlite::Connection raw = Raw();
  const std::string row = "(id, episode, judge, label, stages, reason, rubric_version) VALUES (1, '" + Key(1).Id() +
                          "', 'x', 'success', '{}', '', '')";
  for (const std::string& sql :
       {std::string("UPDATE verdicts SET label = 'success'"), std::string("DELETE FROM verdicts"),
        "INSERT OR REPLACE INTO verdicts " + row, "REPLACE INTO verdicts " + row}) {
    EXPECT_THAT(MessageOf([&] { raw.RunScript(sql); }, ExitCode::kInternal), HasSubstr("append-only")) << sql;
  }
  EXPECT_THAT(MessageOf([&] { raw.RunScript("DELETE FROM episodes"); }, ExitCode::kInternal),
              HasSubstr("never deleted"));
  EXPECT_THAT(MessageOf([&] { raw.RunScript("UPDATE episodes SET chunks = 9"); }, ExitCode::kInternal),
              HasSubstr("never changed"));
  EXPECT_THAT(MessageOf([&] { raw.RunScript("INSERT INTO removals SELECT id FROM episodes"); }, ExitCode::kInternal),
              HasSubstr("only a failed"));
  EXPECT_EQ(Store::Open(run_, Store::Mode::kReadOnly).Verdicts().at(0).label, Label::kFailure);
}

TEST_F(StoreTest, OnlyAFailedEpisodeIsRemovedAndThenWithAllItHad) {
  Store store = NewRun();
  store.Add(SomeEpisode(store, Key(1), StopReason::kPolicyError));
  store.Add(SomeEpisode(store, Key(2)));
  store.AddVerdict(SomeVerdict("oracle", Label::kInvalid));
  EXPECT_THAT(MessageOf([&] { store.RemoveFailed(Key(2)); }, ExitCode::kInternal), HasSubstr("not failed"));
  EXPECT_THAT(MessageOf([&] { store.RemoveFailed(Key(3)); }, ExitCode::kInternal), HasSubstr("not in the store"));
  store.RemoveFailed(Key(1));
  EXPECT_FALSE(store.Has(Key(1)));
  EXPECT_TRUE(store.Has(Key(2)));
  EXPECT_THAT(store.Verdicts(), IsEmpty());
  EXPECT_THAT(store.LoadPrivileged(Key(1).Id()), IsEmpty());
  EXPECT_FALSE(std::filesystem::exists(store.VideoPath(Key(1))));
  store.Add(SomeEpisode(store, Key(1)));
  EXPECT_EQ(store.Episodes().at(0).failure, "");
}

TEST_F(StoreTest, CountersAddUp) {
  Store store = NewRun();
  store.Count("visual_pick", {{"repeats", 2}, {"stale_replies", 1}});
  store.Count("visual_pick", {{"repeats", 3}});
  EXPECT_EQ(store.CountersByPolicy().at("visual_pick"), (Counters{{"repeats", 5}, {"stale_replies", 1}}));
}

TEST_F(StoreTest, OrphansAreWhatNoRowNames) {
  Store store = NewRun();
  store.Add(SomeEpisode(store, Key(1)));
  SomeEpisode(store, Key(2));  // its video is there, its row never came
  std::ofstream(run_ / "videos/sim/half.mp4.tmp") << "half";
  std::ofstream(run_ / "thumbs/sim/stray.jpg") << "stray";
  std::ofstream(run_ / "notes.txt") << "the user's own";
  store.RemoveOrphans();
  EXPECT_THAT(FilesBelow(run_ / "videos"), ElementsAre("sim/take_bottle/visual_pick@good/41-0007-s1.mp4"));
  EXPECT_THAT(FilesBelow(run_ / "thumbs"), ElementsAre("sim/take_bottle/visual_pick@good/41-0007-s1.jpg"));
  EXPECT_TRUE(std::filesystem::exists(run_ / "notes.txt"));
}

TEST_F(StoreTest, ARunGoesOnWithTheSameSuiteAndNotWithAnother) {
  {
    Store begun = NewRun();
    begun.Add(SomeEpisode(begun, Key(1)));
  }
  Store store = Store::CreateOrContinue(run_, SomeRun());
  EXPECT_EQ(store.run().suite_text, SomeRun().suite_text);
  EXPECT_EQ(store.Tasks().size(), 1u);
  store = Store::InMemory(folder_ / "m", SomeRun());  // lets the lock go
  RunInfo other = SomeRun();
  other.suite_hash = "07e42";
  EXPECT_THAT(MessageOf([&] { Store::CreateOrContinue(run_, other); }), AllOf(HasSubstr("5417e"), HasSubstr("07e42")));
}

TEST_F(StoreTest, ARunThatNeverCameToAnEpisodeMakesRoomForTheMendedSuite) {
  SplitMix64 random(1);
  {
    Store store = NewRun();
    store.AddInitialScene(Key(1).pair, {{Image(1), Image(2)}, SomeArms(random), SomeTask().cameras});
    store.Count("visual_pick@good", {{"repeats", 1}});
  }
  RunInfo mended = SomeRun();
  mended.suite_hash = "07e42";
  mended.suite_text = "name: mended\n";
  Store store = Store::CreateOrContinue(run_, mended);
  EXPECT_EQ(store.run().suite_hash, "07e42");
  EXPECT_EQ(store.run().suite_text, "name: mended\n");
  EXPECT_THAT(store.Tasks(), IsEmpty());
  EXPECT_THAT(store.Worlds(), IsEmpty());
  EXPECT_THAT(store.Policies(), IsEmpty());
  EXPECT_THAT(store.InitialScenes(), IsEmpty());
  EXPECT_THAT(store.CountersByPolicy(), IsEmpty());
}

TEST_F(StoreTest, ASecondWriterIsRefusedAndReadersAreNot) {
  Store store = NewRun();
  const std::string number = std::to_string(::getpid());
  EXPECT_THAT(MessageOf([&] { Store::CreateOrContinue(run_, SomeRun()); }),
              AllOf(HasSubstr("process " + number), HasSubstr(run_.string())));
  EXPECT_THAT(MessageOf([&] { Store::Open(run_, Store::Mode::kReadWrite); }), HasSubstr(number));
  const Store reader = Store::Open(run_, Store::Mode::kReadOnly);
  store.Add(SomeEpisode(store, Key(1)));
  EXPECT_EQ(reader.Episodes().size(), 1u);
}

TEST_F(StoreTest, AReaderCannotWrite) {
  { NewRun(); }
  Store reader = Store::Open(run_, Store::Mode::kReadOnly);
  EXPECT_THAT(MessageOf([&] { reader.Count("a", {{"b", 1}}); }, ExitCode::kInternal), HasSubstr("reading only"));
  EXPECT_THAT(MessageOf([&] { reader.RemoveOrphans(); }, ExitCode::kInternal), HasSubstr("reading only"));
}

TEST_F(StoreTest, WhatIsNoRunIsRefusedByName) {
  EXPECT_THAT(MessageOf([&] { Store::Open(run_, Store::Mode::kReadOnly); }),
              AllOf(HasSubstr(run_.string()), HasSubstr("no run")));
  std::filesystem::create_directories(run_);
  std::ofstream(run_ / "evac.sqlite") << std::string(4096, 'x');
  EXPECT_THAT(MessageOf([&] { Store::Open(run_, Store::Mode::kReadOnly); }), HasSubstr("evac.sqlite"));
  EXPECT_THAT(MessageOf([&] { Store::CreateOrContinue(run_, SomeRun()); }), HasSubstr("evac.sqlite"));
  std::filesystem::remove(run_ / "evac.sqlite");
  Raw().RunScript("CREATE TABLE songs (title TEXT)");
  EXPECT_THAT(MessageOf([&] { Store::CreateOrContinue(run_, SomeRun()); }), HasSubstr("another program's"));
}

TEST_F(StoreTest, ANewerSchemaIsRefusedAndLeftAsItIs) {
  { NewRun(); }
  Raw().RunScript("PRAGMA user_version = 1000");
  for (const auto& open : std::vector<std::function<void()>>{[&] { Store::Open(run_, Store::Mode::kReadOnly); },
                                                             [&] { Store::Open(run_, Store::Mode::kReadWrite); },
                                                             [&] { Store::CreateOrContinue(run_, SomeRun()); }}) {
    EXPECT_THAT(MessageOf(open), AllOf(HasSubstr("schema version 1000"), HasSubstr("newer evac")));
  }
  sqlite::Connection raw = Raw();
  auto version = raw.Query("PRAGMA user_version");
  ASSERT_TRUE(version.Step());
  EXPECT_EQ(version.Integer(0), 1000);
}

TEST(Schema, AnOlderDatabaseIsBroughtForwardStepByStepWithItsRows) {
  const char* const steps[] = {"CREATE TABLE a (x INTEGER); INSERT INTO a VALUES (7)",
                               "ALTER TABLE a ADD COLUMN y INTEGER DEFAULT 8",
                               "CREATE TABLE b (z INTEGER); this is no SQL"};
  sqlite::Connection connection = sqlite::Connection::OpenInMemory();
  const std::span<const char* const> all = steps;
  schema::Migrate(connection, all.first(1), "f");
  schema::Migrate(connection, all.first(2), "f");
  schema::Migrate(connection, all.first(2), "f");  // nothing left to do
  auto row = connection.Query("SELECT x, y FROM a");
  ASSERT_TRUE(row.Step());
  EXPECT_EQ(row.Integer(0) * 10 + row.Integer(1), 78);
  EXPECT_FALSE(row.Step());
  EXPECT_THROW(schema::Migrate(connection, all, "f"), Error);
  EXPECT_EQ(schema::Version(connection, all, "f"), 2);  // the broken step left nothing
  EXPECT_FALSE(connection.Query("SELECT 1 FROM sqlite_schema WHERE name = 'b'").Step());
}

TEST_F(StoreTest, ThreadsMayAddAndReadAtOnce) {
  Store store = NewRun();
  std::atomic<bool> done = false;
  std::vector<std::thread> threads;
  for (int lane = 0; lane < 4; ++lane) {
    threads.emplace_back([&store, lane] {
      for (int i = 0; i < 5; ++i) store.Add(SomeEpisode(store, Key(10 * lane + i)));
    });
  }
  std::thread reader([&] {
    while (!done) store.Episodes();
  });
  for (std::thread& thread : threads) thread.join();
  done = true;
  reader.join();
  EXPECT_EQ(store.Episodes().size(), 20u);
}

TEST_F(StoreTest, TheStoreInMemoryKeepsOnlyFilesOnDisk) {
  Store store = Store::InMemory(run_, SomeRun());
  Declare(store);
  store.Add(SomeEpisode(store, Key(1)));
  EXPECT_TRUE(store.Has(Key(1)));
  EXPECT_EQ(FilesBelow(run_).size(), 2u);  // video and thumbnail
}

}  // namespace
}  // namespace evac
