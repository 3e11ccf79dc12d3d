#include "harness/suite.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <fstream>
#include <set>

#include "core/error.h"
#include "core/file.h"
#include "harness/scheduler.h"
#include "harness/suite_hash.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using ::testing::HasSubstr;

constexpr const char* kSuite = R"(
suite: tiny
recording: rec
worlds:
  - {name: echo, type: echo}
policies:
  - {name: replay, checkpoint: a, command: [evac-policy, replay]}
  - {name: replay, checkpoint: b, command: [evac-policy, replay]}
seeds: [1, 2]
lanes: 2
)";

class SuiteTest : public ::testing::Test {
 protected:
  SuiteTest() {
    std::filesystem::create_directory(folder_ / "rec");
    Write("rec/action.npy", "bytes");
  }
  std::filesystem::path Write(const std::string& name, const std::string& text) {
    std::ofstream(folder_ / name) << text;
    return folder_ / name;
  }
  std::string Complaint(const std::string& text, const std::vector<std::string>& assignments = {}) {
    return Complaint(Write("suite.yaml", text), assignments);
  }
  std::string Complaint(const std::filesystem::path& suite, const std::vector<std::string>& assignments) {
    try {
      ReadSuite(suite, assignments);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      return error.what();
    }
    return "no complaint";
  }
  /// A suite of one task: a page of that name, whose scene is that file.
  std::filesystem::path WriteSuiteOf(const std::string& page, const std::string& scene) {
    std::string text = ReadFile(EVAC_SOURCE_DIR "/worldmodel/sim/scenes/take_bottle.yaml");
    Write(page, text.replace(text.find("scene: take_bottle.xml"), 22, "scene: " + scene));
    std::string suite = ReadFile(EVAC_SOURCE_DIR "/tests/system/small.yaml");
    suite.replace(suite.find("../../worldmodel/sim/scenes/take_bottle.yaml"), 44, (folder_ / page).string());
    for (std::size_t at; (at = suite.find("../../worldmodel")) != std::string::npos;)
      suite.replace(at, 5, EVAC_SOURCE_DIR);
    return Write("suite.yaml", suite);
  }
  TempFolder folder_;
};

TEST_F(SuiteTest, AnUnknownKeyIsNamedWithItsLineAndTheNearestKnownOne) {
  EXPECT_THAT(Complaint(std::string(kSuite) + "lane: 3\n"), AllOf(HasSubstr("suite.yaml:11"), HasSubstr("field lane"), HasSubstr("'lanes'")));
}

TEST_F(SuiteTest, AWrongTypeSaysWhatWasFoundAndWhatWasWanted) {
  EXPECT_THAT(Complaint(std::string(kSuite) + "chunk_size: many\n"), AllOf(HasSubstr("field chunk_size"), HasSubstr("'many'"), HasSubstr("a whole number")));
}

TEST_F(SuiteTest, ASecondRealWorldOrATwinPolicyIsRefused) {
  EXPECT_THAT(Complaint(std::string(kSuite), {"policies.1.checkpoint=a"}), HasSubstr("'replay@a' is there twice"));
  const std::filesystem::path two_worlds = EVAC_SOURCE_DIR "/tests/system/small.yaml";
  EXPECT_THAT(Complaint(two_worlds, {"worlds.1.role=real"}),
              AllOf(HasSubstr("field worlds"), HasSubstr("wanted at most one world with role: real")));
}

TEST_F(SuiteTest, ASeedThatIsThereTwiceIsRefusedBeforeTheSecondEpisodeOfItsName) {
  EXPECT_THAT(Complaint(std::string(kSuite), {"seeds=[1, 2, 1]"}), AllOf(HasSubstr("field seeds"), HasSubstr("'1' is there twice, wanted distinct seeds")));
}

TEST_F(SuiteTest, AJudgeThatNoRunHasIsRefusedBeforeTheFirstEpisodeAndNotAfterTheLast) {
  for (const char* judges : {"judges=[classifier]", "judges=[oracel]", "judges=[oracle, human]"})
    EXPECT_THAT(Complaint(std::string(kSuite), {judges}), AllOf(HasSubstr("field judges"), HasSubstr("wanted [oracle] or none"))) << judges;
  for (const char* judges : {"judges=[oracle]", "judges=[]"}) EXPECT_EQ(Complaint(std::string(kSuite), {judges}), "no complaint") << judges;
}

TEST_F(SuiteTest, AWorldMayTryTheFirstOfTheInitialStatesAlone) {
  const auto read = [](std::vector<std::string> set) {
    set.insert(set.begin(), "initial_states.count=20");
    return ReadSuite(EVAC_SOURCE_DIR "/apps/configs/demo.yaml", set);
  };
  const Suite suite = read({"worlds.1.initial_states=5"});
  EXPECT_EQ(StatesOf(suite, suite.worlds[0]).size(), suite.initial_states.size());
  ASSERT_EQ(StatesOf(suite, suite.worlds[1]).size(), 5u);
  EXPECT_EQ(StatesOf(suite, suite.worlds[1])[4].id, suite.initial_states[4].id);
  EXPECT_EQ(AllJobs(suite, suite.worlds[1], suite.policies[0]).size(), 5 * suite.tasks.size() * suite.seeds.size());
  EXPECT_NE(suite.hash, read({}).hash);
  for (const auto& [wrong, wanted] :
       {std::pair("0", "at least 1"), {"-1", "at least 1"}, {"21", "at most the suite's 20"}}) {
    EXPECT_THAT([&] { read({fmt::format("worlds.1.initial_states={}", wrong)}); },
                ::testing::ThrowsMessage<Error>(
                    HasSubstr(fmt::format("initial_states: found '{}', wanted {}", wrong, wanted))));
  }
}

TEST_F(SuiteTest, OnlyASimulatedWorldBesideTheRealOneMayGoUnfilmed) {
  const std::filesystem::path small = EVAC_SOURCE_DIR "/tests/system/small.yaml";
  EXPECT_TRUE(ReadSuite(small, {}).worlds[1].film);
  const Suite suite = ReadSuite(small, {"worlds.1.film=false"});
  EXPECT_TRUE(suite.worlds[0].film);
  EXPECT_FALSE(suite.worlds[1].film);
  EXPECT_THAT(Complaint(small, {"worlds.0.film=false"}), HasSubstr("film: found 'false', wanted true"));
  EXPECT_THAT(Complaint(std::string(kSuite), {"worlds.0.film=false"}), HasSubstr("film: found 'false', wanted true"));
}

TEST_F(SuiteTest, SetOverridesAnyFieldAndChangesTheHash) {
  const auto path = Write("suite.yaml", kSuite);
  const Suite plain = ReadSuite(path, {}), changed = ReadSuite(path, {"policies.1.checkpoint=c", "chunk_size=4"});
  EXPECT_EQ(changed.policies[1].checkpoint, "c");
  EXPECT_EQ(changed.chunk_size, 4);
  EXPECT_NE(plain.hash, changed.hash);
  EXPECT_EQ(ReadSuite(path, {"transport.start_s=7"}).transport.start_s, 7) << "the page has no such section";
  EXPECT_THAT(Complaint(std::string(kSuite), {"nowhere.field=1"}), HasSubstr("(--set): field nowhere: there is no such field"));
  EXPECT_THAT(Complaint(std::string(kSuite), {"transport.start=1"}), AllOf(HasSubstr("transport.start:"), HasSubstr("'start_s'")));
}

TEST_F(SuiteTest, TheHashIgnoresCommentsLayoutAndSpeedButNotTheContentOfFiles) {
  const auto path = Write("suite.yaml", kSuite);
  const std::string hash = ReadSuite(path, {}).hash;
  EXPECT_EQ(ReadSuite(Write("other.yaml", std::string("# a comment\n") + kSuite), {}).hash, hash);
  EXPECT_EQ(ReadSuite(path, {"lanes=7", "error_budget=0.5"}).hash, hash);
  Write("rec/action.npy", "other bytes");
  EXPECT_NE(ReadSuite(path, {}).hash, hash);
}

/// Runs of one recording in two folders went into one OUT, and shards of them lost episodes or held them twice.
TEST_F(SuiteTest, TheHashCoversWhatARecordingsTaskIsCalled) {
  const auto path = Write("suite.yaml", kSuite);
  for (const std::string folder : {"other", "elsewhere/rec", "many/a", "several/a"}) {
    std::filesystem::create_directories(folder_ / folder);
    Write(folder + "/action.npy", "bytes");
  }
  std::filesystem::create_directory_symlink(folder_ / "rec", folder_ / "link");
  const auto hash = [&](const char* recording) {
    return ReadSuite(path, {"recording=" + (folder_ / recording).string()}).hash;
  };
  EXPECT_NE(hash("other"), hash("rec"));
  EXPECT_NE(hash("several"), hash("many")) << "of several the task is called like their folder";
  EXPECT_EQ(hash("elsewhere/rec"), hash("rec"));
  EXPECT_EQ(hash("link"), hash("rec"));
}

/// Runs of one task from recordings in two folders were of two tasks to judges and comparisons.
TEST_F(SuiteTest, ARecordingsTaskIsCalledAsThePageSaysWhereverItLies) {
  std::filesystem::create_directory(folder_ / "other");
  Write("other/action.npy", "bytes");
  const auto path = Write("suite.yaml", std::string(kSuite) + "task: pour\n");
  const Suite suite = ReadSuite(path, {});
  EXPECT_EQ(suite.recorded_task.name, "pour");
  EXPECT_EQ(ReadSuite(path, {"recording=" + (folder_ / "other").string()}).hash, suite.hash);
  EXPECT_NE(ReadSuite(path, {"task=stack"}).hash, suite.hash);
  EXPECT_THAT(Complaint(path, {"task=a/b"}), HasSubstr("field task"));
  EXPECT_THAT(Complaint(std::filesystem::path(EVAC_SOURCE_DIR "/tests/system/small.yaml"), {"task=pour"}),
              AllOf(HasSubstr("field task"), HasSubstr("none but beside a `recording`")));
}

/// All depth pictures below a recording were hashed whenever a suite was read, and one more ended `resume`.
TEST_F(SuiteTest, TheHashCoversOfRecordingsWhatIsReadOfThemAndAllWhereAPolicyIsToldWhereTheyLie) {
  const auto make = [&](const std::string& name) {
    std::filesystem::create_directories((folder_ / name).parent_path());
    Write(name, name);
  };
  const std::string camera = "tree/parameters/carry/1/parameters/camera/";
  const std::vector<std::string> read = {"tree/observations/carry/1/videos/head_color.mp4",
                                         "tree/proprio_stats/carry/1/proprio_stats.h5",
                                         camera + "head_intrinsic_params.json",
                                         camera + "head_extrinsic_params_aligned.json",
                                         "clips/a/proprio_stats.h5", "clips/a/frame.png", "clips/b/action.npy"};
  for (const std::string& name : read) make(name);
  const auto path = Write("suite.yaml", kSuite);
  const std::vector<std::string> recordings = {"tree", "tree/observations/carry", "tree/observations/carry/1", "clips",
                                               "clips/a"};
  const auto hashes = [&](const std::string& more = "seeds=[1]") {
    std::vector<std::string> found;
    for (const std::string& recording : recordings)
      found.push_back(ReadSuite(path, {"recording=" + (folder_ / recording).string(), more}).hash);
    return found;
  };
  const std::string told = R"(policies.0.command=[mine, "${recording}"])";
  const std::vector<std::string> before = hashes(), before_told = hashes(told);
  for (const std::string& name : {std::string("tree/observations/carry/1/depth/head_depth_000000.png"),
                                  std::string("tree/observations/carry/1/tactile/left.h5"), camera + "notes.txt",
                                  std::string("clips/a/depth.png"), std::string("clips/a/more/depth.png")})
    make(name);
  EXPECT_EQ(hashes(), before);
  const Suite suite = ReadSuite(path, {"recording=" + (folder_ / "tree").string()});
  EXPECT_EQ(suite.hashed_files.size(), 4U) << "nothing else of the tree is read at all";
  const std::vector<std::string> now_told = hashes(told);
  for (std::size_t i = 0; i < recordings.size(); ++i) {
    const bool is_one = recordings[i].ends_with("/1") || recordings[i].ends_with("/a");  // of several nobody is told
    EXPECT_EQ(now_told[i] != before_told[i], is_one) << recordings[i];
  }
  for (const std::string& name : read) {
    Write(name, "another");
    EXPECT_NE(hashes(), before) << name;
    Write(name, name);
  }
  EXPECT_EQ(hashes(), before);
}

TEST_F(SuiteTest, TheHashCoversWhatASceneInAnotherFolderThanItsPageIsMadeOf) {
  for (const char* name : {"tasks", "mjcf", "mjcf/meshes"}) std::filesystem::create_directory(folder_ / name);
  const auto path = WriteSuiteOf("tasks/take_bottle.yaml", "../mjcf/scene.xml");
  Write("mjcf/scene.xml", R"(<mujoco><include file="robot.xml"/><compiler meshdir="meshes"/></mujoco>)");
  Write("mjcf/robot.xml", R"(<mujoco><asset><mesh file="hand.stl"/></asset></mujoco>)");
  Write("mjcf/meshes/hand.stl", "a hand");
  std::set<std::string> hashes = {ReadSuite(path, {}).hash};
  Write("mjcf/robot.xml", R"(<mujoco><asset><mesh file="hand.stl" scale="2 2 2"/></asset></mujoco>)");
  EXPECT_TRUE(hashes.insert(ReadSuite(path, {}).hash).second) << "an included file";
  Write("mjcf/meshes/hand.stl", "another hand");
  EXPECT_TRUE(hashes.insert(ReadSuite(path, {}).hash).second) << "a mesh";
}

/// Only what was called .xml was looked into: a run went on with another mesh of a scene.mjcf, and with another scene
/// that had no ending at all.
TEST_F(SuiteTest, TheHashCoversWhatASceneIsMadeOfWhateverItAndItsIncludesAreCalled) {
  std::filesystem::create_directories(folder_ / "mjcf/meshes");
  for (const std::string ending : {".xml", ".mjcf", ".XML", ""}) {
    const std::string scene = "mjcf/scene" + ending, robot = "mjcf/robot" + ending;
    const auto path = WriteSuiteOf("take_bottle.yaml", scene);
    Write(scene, R"(<mujoco><compiler meshdir="meshes"/><include file="robot)" + ending + R"("/></mujoco>)");
    Write(robot, R"(<mujoco><asset><mesh file="hand.stl"/></asset></mujoco>)");
    Write("mjcf/meshes/hand.stl", "a hand");
    std::set<std::string> hashes = {ReadSuite(path, {}).hash};
    for (const std::string& file : {scene, robot, std::string("mjcf/meshes/hand.stl")}) {
      Write(file, ReadFile(folder_ / file) + "<!-- another -->");
      EXPECT_TRUE(hashes.insert(ReadSuite(path, {}).hash).second) << scene << ": " << file;
    }
  }
}

TEST_F(SuiteTest, TheHashCoversTheFilesThatAPolicyListsAndWhichItDoesNotIsKnown) {
  const std::string text = R"(
suite: tiny
recording: rec
worlds:
  - {name: echo, type: echo}
policies:
  - {name: mine, command: [python3, policy.py, --weights=net/step_9.bin, --seed, "3"], files: [policy.py, net/, ../elsewhere]}
)";
  std::filesystem::create_directories(folder_ / "suites/net");
  std::filesystem::create_directories(folder_ / "suites/rec");
  Write("elsewhere", "one"), Write("suites/rec/action.npy", "bytes");
  Write("suites/policy.py", "one"), Write("suites/net/step_9.bin", "one"), Write("suites/net/norm.json", "one");
  const auto path = Write("suites/suite.yaml", text);
  std::string last = ReadSuite(path, {}).hash;
  EXPECT_EQ(ReadSuite(path, {}).hash, last);
  for (const char* file : {"suites/policy.py", "suites/net/step_9.bin", "suites/net/norm.json", "elsewhere"}) {
    Write(file, "another");
    const std::string now = ReadSuite(path, {}).hash;
    EXPECT_NE(now, last) << file;
    last = now;
  }
  const auto unlisted = [&](const std::vector<std::string>& assignments, const std::filesystem::path& suite_path) {
    const Suite suite = ReadSuite(suite_path, assignments);
    return FilesInNoHash(suite, suite.policies[0]);
  };
  EXPECT_THAT(unlisted({}, path), testing::IsEmpty());
  EXPECT_THAT(unlisted({}, std::filesystem::relative(path)), testing::IsEmpty());
  EXPECT_THAT(unlisted({"policies.0.files=[]"}, path), testing::ElementsAre("policy.py", "net/step_9.bin"));
  EXPECT_THAT(Complaint(path, {"policies.0.files=[nowhere]"}), AllOf(HasSubstr("files"), HasSubstr("nowhere")));
}

/// Shards whose nodes had the same weights in scratch folders of their own were "runs of different suites".
TEST_F(SuiteTest, TheHashTakesAPolicysFilesByContentWhereverTheyLie) {
  const auto path = Write("suite.yaml", kSuite);
  for (const std::string node : {"a", "b"}) {
    std::filesystem::create_directories(folder_ / node / "net");
    Write(node + "/policy.pt", "weights"), Write(node + "/net/norm.json", "norm");
  }
  const auto hash = [&](const std::string& node, const std::string& field = "policies.0.files") {
    const std::string weights = (folder_ / node / "policy.pt").string(), net = (folder_ / node / "net").string();
    return ReadSuite(path, {field + "=[" + weights + ", " + net + "]"}).hash;
  };
  const std::string alike = hash("a");
  EXPECT_EQ(hash("b"), alike);
  EXPECT_NE(hash("b", "policies.1.files"), alike) << "another policy's";
  EXPECT_NE(ReadSuite(path, {"policies.0.files=[" + (folder_ / "a/net").string() + "]"}).hash, alike) << "one is gone";
  Write("b/net/norm.json", "another");
  EXPECT_NE(hash("b"), alike);
}

/// Python writes there as it first imports the modules: the run could not be resumed, nor merged with its other part.
TEST_F(SuiteTest, WhatPythonWritesBesideAPolicysModulesIsInNoHash) {
  std::filesystem::create_directories(folder_ / "mine/parts");
  Write("mine/policy.py", "one"), Write("mine/parts/net.py", "one");
  const auto path = Write("suite.yaml", kSuite);
  const auto read = [&] { return ReadSuite(path, {"policies.0.files=[" + (folder_ / "mine").string() + "]"}); };
  const Suite before = read();
  const std::string policy = PolicyHash(before.policies[0]);
  for (const std::string cache : {"mine/__pycache__", "mine/parts/__pycache__"}) {
    std::filesystem::create_directory(folder_ / cache);
    Write(cache + "/net.cpython-311.pyc", "bytes");
  }
  EXPECT_EQ(read().hash, before.hash);
  EXPECT_EQ(PolicyHash(before.policies[0]), policy);
  EXPECT_EQ(read().hashed_files.size(), before.hashed_files.size()) << "nobody looks at it again";
  Write("mine/parts/net.py", "another");
  EXPECT_NE(read().hash, before.hash);
}

TEST_F(SuiteTest, AFolderThatACommandNamesAndFilesDoesNotIsKnownButForTheSuitesOwn) {
  std::filesystem::create_directory(folder_ / "weights");
  const auto path = Write("suite.yaml", kSuite);
  const auto unlisted = [&](const std::string& files) {
    const Suite suite = ReadSuite(path, {"policies.0.command=[mine, weights/, --net=weights, ., --out=]", files});
    return FilesInNoHash(suite, suite.policies[0]);
  };
  EXPECT_THAT(unlisted("policies.0.files=[]"), testing::ElementsAre("weights/", "weights"));
  EXPECT_THAT(unlisted("policies.0.files=[" + (folder_ / "weights").string() + "]"), testing::IsEmpty());
}

/// A policy was compared with itself.
TEST_F(SuiteTest, TwoPoliciesThatJoinOneProcessAndATokenThatNoChannelCanHoldAreRefused) {
  const auto joining = [&](int port, const std::string& token) {
    const auto join = [](const char* name, int at, int ttl, const std::string& word) {
      return fmt::format("{{name: {}, join: {{url: \"udpm://239.255.76.67:{}?ttl={}\", token: \"{}\"}}}}", name, at,
                         ttl, word);
    };
    return Complaint(std::string(kSuite), {"policies.0=" + join("a", 7700, 0, "mine"),
                                           "policies.1=" + join("b", port, 1, token)});
  };
  EXPECT_THAT(joining(7700, "mine"), HasSubstr("field policies: 'join: {url: udpm://239.255.76.67:7700, token: mine}' "
                                               "is there twice"));
  EXPECT_EQ(joining(7701, "mine"), "no complaint");
  EXPECT_EQ(joining(7700, "yours-2"), "no complaint");
  for (const std::string token : {"my_policy", "", "a b", "abcdefghijklmnopqrstuvwxyz-0123456"})
    EXPECT_THAT(joining(7701, token), AllOf(HasSubstr("join.token"), HasSubstr("letters, digits and '-'"))) << token;
}

TEST_F(SuiteTest, WhatIsPlannedIsHowManyJobsThereAre) {
  const Suite suite =
      ReadSuite(EVAC_SOURCE_DIR "/tests/system/small.yaml", {"seeds=[1, 2]", "worlds.1.initial_states=1"});
  std::int64_t all = 0;
  for (const PlannedEpisodes& planned : PlannedOf(suite)) {
    EXPECT_EQ(planned.episodes, planned.world == "sim" ? 2 : 4);
    all += planned.episodes;
  }
  std::size_t jobs = 0;
  for (const SuiteWorld& world : suite.worlds) {
    for (const SuitePolicy& policy : suite.policies) jobs += AllJobs(suite, world, policy).size();
  }
  EXPECT_EQ(all, static_cast<std::int64_t>(jobs));
}

TEST_F(SuiteTest, ItsStopRuleIsCheckedAsATasksIs) {
  const auto demo = std::filesystem::path(EVAC_SOURCE_DIR) / "apps/configs/demo.yaml";
  EXPECT_EQ(ReadSuite(demo, {"still={dwell_chunks: 4}"}).tasks.at(0).still.dwell_chunks, 4);
  EXPECT_THAT(Complaint(demo, {"still={min_chunks: -1}"}), HasSubstr("min_chunks"));
  EXPECT_THAT(Complaint(demo, {"still={rotation_rad: -0.1}"}), HasSubstr("rotation_rad"));
}

TEST_F(SuiteTest, APresetThatTheEncoderDoesNotKnowIsRefusedBeforeTheFirstVideo) {
  EXPECT_THAT(Complaint(std::string(kSuite) + "video: {preset: quick}\n"),
              AllOf(HasSubstr("field video.preset"), HasSubstr("quick"), HasSubstr("ultrafast, superfast, veryfast")));
}

TEST_F(SuiteTest, LatencyIsOffMeasuredOrSecondsAndAPartOfTheHashAsTheProbeIsNot) {
  const auto path = Write("suite.yaml", kSuite);
  EXPECT_EQ(ReadSuite(path, {}).latency.kind, PolicyLatency::Kind::kOff);
  EXPECT_EQ(ReadSuite(path, {"policy={latency: 0.3}"}).latency.Text(), "0.3 s");
  EXPECT_EQ(ReadSuite(path, {"policy={latency: measured}", "lanes=1"}).latency.Text(), "measured");
  EXPECT_THAT(Complaint(std::string(kSuite), {"policy={latency: measured}"}), HasSubstr("lanes: 1"));
  EXPECT_THAT(Complaint(std::string(kSuite), {"policy={latency: -2}"}), HasSubstr("field policy.latency"));
  EXPECT_NE(ReadSuite(path, {"policy={latency: 0.3}"}).hash, ReadSuite(path, {"policy={latency: 0.4}"}).hash);
  EXPECT_EQ(ReadSuite(path, {"policy={latency: 0.3, start_probe: warn}"}).hash, ReadSuite(path, {"policy={latency: 0.3}"}).hash);
  EXPECT_THAT(Complaint(std::string(kSuite), {"policy={start_probe: perhaps}"}), HasSubstr("refuse, warn or off"));
}

TEST_F(SuiteTest, PathsInSetAreRelativeToTheWorkingDirectory) {
  const auto path = Write("suite.yaml", kSuite);
  const auto relative = std::filesystem::relative(folder_ / "rec");
  EXPECT_EQ(ReadSuite(path, {"recording=" + relative.string()}).recording, (folder_ / "rec").lexically_normal());
  const std::filesystem::path source = EVAC_SOURCE_DIR;
  const auto page = std::filesystem::relative(source / "worldmodel/sim/scenes/take_ham.yaml");
  const Suite suite = ReadSuite(source / "apps/configs/demo.yaml", {"tasks=[" + page.string() + "]"});
  ASSERT_EQ(suite.tasks.size(), 1u);
  EXPECT_EQ(suite.tasks[0].id, "take_ham");
}

/// "recording=rec #1" was the recording "rec".
TEST_F(SuiteTest, APathInSetIsTakenLetterByLetter) {
  const auto path = Write("suite.yaml", kSuite);
  for (const char* name : {"rec #1", "a: b", "a, b]", "q\"\\q", "two\nlines", "&x", "*x"}) {
    const auto recording = folder_ / "odd" / name;
    std::filesystem::create_directories(recording);
    std::ofstream(recording / "action.npy") << "bytes";
    EXPECT_EQ(ReadSuite(path, {"recording=" + recording.string()}).recording, recording);
  }
  EXPECT_EQ(ReadSuite(path, {"recording='" + (folder_ / "rec").string() + "'"}).recording, folder_ / "rec");
}

TEST_F(SuiteTest, FilesOfAPolicyInAMappingThatIsSetAreRelativeToTheWorkingDirectory) {
  const auto path = Write("suite.yaml", kSuite);
  const auto file = std::filesystem::relative(Write("policy.py", "one")).string();
  const Suite suite = ReadSuite(path, {"policies.0={name: mine, command: [x], files: [" + file + "]}"});
  EXPECT_THAT(suite.policies[0].files, testing::ElementsAre((folder_ / "policy.py").string()));
  EXPECT_THAT(Complaint(path, {"policies.0={name: mine, command: [x], files: [\"\"]}"}), HasSubstr("files"));
}

/// It was taken, and refused where the worlds were made.
TEST_F(SuiteTest, MoreThreadsThanAWorldTakesAreRefused) {
  EXPECT_EQ(Complaint(std::string(kSuite), {"threads=256"}), "no complaint");
  EXPECT_THAT(Complaint(std::string(kSuite), {"threads=257"}), AllOf(HasSubstr("field threads"), HasSubstr("256")));
}

/// The clock's count overflowed: a policy was given up at once, or never.
TEST_F(SuiteTest, AWaitOfMoreThanADayIsRefused) {
  for (const char* field : {"deadline_s", "repeat_after_s", "start_s"}) {
    EXPECT_EQ(Complaint(std::string(kSuite), {fmt::format("transport={{{}: 86400}}", field)}), "no complaint");
    for (const char* wait : {"86401", "1e10", "0"})
      EXPECT_THAT(Complaint(std::string(kSuite), {fmt::format("transport={{{}: {}}}", field, wait)}),
                  AllOf(HasSubstr(fmt::format("field transport.{}", field)), HasSubstr("at most 86400 s")));
  }
}

TEST_F(SuiteTest, TheStoredTextReadsAsTheSameSuite) {
  const Suite suite = ReadSuite(Write("suite.yaml", kSuite), {"seeds=[3]"});
  const Suite again = ParseSuite(suite.text, suite.path);
  EXPECT_EQ(again.hash, suite.hash);
  EXPECT_EQ(again.seeds, std::vector<std::uint64_t>{3});
}

/// .29 of 100 is 28.999999999999996 in binary.
TEST(ErrorBudget, IsAsManyEpisodesAsTheShareSaysInDecimals) {
  const auto allowed = [](double budget, int episodes) {
    Suite suite;
    suite.error_budget = budget;
    return AllowedFailures(suite, episodes);
  };
  EXPECT_EQ(allowed(.29, 100), 29);
  EXPECT_EQ(allowed(.57, 100), 57);
  EXPECT_EQ(allowed(.58, 50), 29);
  EXPECT_EQ(allowed(.1, 100), 10);
  EXPECT_EQ(allowed(.1, 99), 9) << "rounded down";
  EXPECT_EQ(allowed(0, 100), 0);
  EXPECT_EQ(allowed(1, 100), 100);
}

TEST(Scheduler, PairsShareTheirSeedsAcrossWorldsAndWorldsAcrossPolicies) {
  Suite suite;
  suite.tasks.resize(1);
  suite.tasks[0].id = "task";
  suite.initial_states = {{"7-0000", 11}, {"7-0001", 12}};
  suite.seeds = {1, 2};
  const SuitePolicy a{"p", "a", {}, "", ""}, b{"p", "b", {}, "", ""};
  const SuiteWorld real{"real", "mujoco", true, ""}, sim{"sim", "mujoco", false, ""};
  const auto real_a = AllJobs(suite, real, a), sim_a = AllJobs(suite, sim, a), real_b = AllJobs(suite, real, b);
  ASSERT_EQ(real_a.size(), 4u);
  for (std::size_t i = 0; i < real_a.size(); ++i) {
    EXPECT_EQ(real_a[i].key.pair, sim_a[i].key.pair);
    EXPECT_EQ(real_a[i].PolicySeed(), sim_a[i].PolicySeed());
    EXPECT_EQ(real_a[i].WorldSeed(), real_b[i].WorldSeed());
    EXPECT_NE(real_a[i].PolicySeed(), real_b[i].PolicySeed());
    EXPECT_EQ(real_a[i].initial.seed, real_b[i].initial.seed);
  }
  EXPECT_NE(real_a[0].PolicySeed(), real_a[1].PolicySeed());
}

TEST(Scheduler, RealityAskedTwiceHasOtherNoiseTheSecondTime) {
  Suite suite;
  suite.tasks.resize(1);
  suite.initial_states = {{"7-0000", 11}};
  suite.seeds = {1};
  const SuitePolicy policy{"p", "a", {}, "", ""};
  const auto seed_in = [&](const SuiteWorld& world) { return AllJobs(suite, world, policy).at(0).WorldSeed(); };
  const std::uint64_t real = seed_in({"real", "mujoco", true, "page"}), again = seed_in({"again", "mujoco", false, "page"});
  EXPECT_NE(again, real);
  EXPECT_NE(seed_in({"third", "mujoco", false, "page"}), again);
  EXPECT_EQ(seed_in({"reality", "mujoco", true, "page"}), real) << "whatever the real world is called";
  EXPECT_EQ(seed_in({"model", "evac", false, ""}), seed_in({"other", "evac", false, ""})) << "checkpoints of a model meet the same noise";
}

TEST(Scheduler, TheRealWorldComesFirst) {
  const auto worlds = RealFirst({{"sim", "mujoco", false, ""}, {"real", "mujoco", true, ""}, {"other", "mujoco", false, ""}});
  EXPECT_EQ(worlds[0].name, "real");
  EXPECT_EQ(worlds[1].name, "sim");
}

}  // namespace
}  // namespace evac
