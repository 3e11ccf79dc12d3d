#include "apps/networks/fidelity_plans.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/networks/fidelity_judge.h"

/// What `evac fidelity` refuses before it asks anybody.
namespace evac {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

SuiteWorld Mujoco(const std::string& name, bool is_real, const std::string& profile) {
  SuiteWorld world;
  world.name = name;
  world.type = "mujoco";
  world.is_real = is_real;
  world.profile = profile;
  return world;
}

SuiteWorld Evac(const std::string& name) {
  SuiteWorld world;
  world.name = name;
  world.type = "evac";
  world.evac.emplace();
  return world;
}

Suite Worlds(std::vector<SuiteWorld> worlds) {
  Suite suite;
  suite.path = "suite.yaml";
  suite.worlds = std::move(worlds);
  return suite;
}

const SuiteWorld kReal = Mujoco("real", true, "a.yaml"), kAgain = Mujoco("again", false, "a.yaml");

TEST(FidelityWorlds, AreOneOfEach) {
  const SuiteWorld other_robot = Mujoco("other", false, "b.yaml");
  const FidelityWorlds worlds = WorldsOf(Worlds({Evac("dream"), other_robot, kAgain, kReal}));
  EXPECT_EQ(worlds.real.name, "real");
  EXPECT_EQ(worlds.again.name, "again");
  EXPECT_EQ(worlds.model.name, "dream");
}

TEST(FidelityWorlds, TwoOfOneSortAreRefusedByTheirNames) {
  EXPECT_THAT([] { WorldsOf(Worlds({kReal, kAgain, Evac("one"), Evac("two")})); },
              ThrowsMessage<Error>(HasSubstr("suite.yaml: field worlds: found one and two, wanted one of type evac")));
  EXPECT_THAT([] { WorldsOf(Worlds({kReal, kAgain, Mujoco("more", false, "a.yaml"), Evac("one")})); },
              ThrowsMessage<Error>(HasSubstr("found again and more, wanted another of type mujoco with the real world's profile")));
  EXPECT_THAT([] { WorldsOf(Worlds({kReal, kAgain})); }, ThrowsMessage<Error>(HasSubstr("field worlds: wanted one of type evac")));
  EXPECT_THAT([] { RunRecordedFidelity({}, Worlds({Evac("one"), Evac("two")})); },
              ThrowsMessage<Error>(HasSubstr("found one and two, wanted one of type evac")));
}

TEST(Fidelity, RefusesOptionsOfPartsThatAreNotAskedFor) {
  using Give = std::function<void(FidelityArguments&)>;
  const auto refuses = [](const char* option, std::vector<std::string> parts, const Give& give) {
    const auto no_such_suite = ThrowsMessage<Error>(HasSubstr("none.yaml"));
    FidelityArguments arguments;
    const auto run = [&] { RunFidelity(arguments); };
    arguments.suite = "none.yaml";
    arguments.parts = std::move(parts);
    EXPECT_THAT(run, no_such_suite) << "nothing is wrong with its options";
    give(arguments);
    EXPECT_THAT(run, ThrowsMessage<Error>(HasSubstr(std::string(option) + ": is of part")));
    arguments.parts = FidelityArguments{}.parts;
    EXPECT_THAT(run, no_such_suite) << "all parts are asked for";
  };
  refuses("--horizon-chunks", {"open"}, [](FidelityArguments& given) { given.horizon_chunks = 5; });
  refuses("--horizon-states", {"closed", "executed"}, [](FidelityArguments& given) { given.horizon_states = 5; });
  refuses("--counterfactual-states", {"open"}, [](FidelityArguments& given) { given.counterfactual_states = 3; });
}

TEST(RecordedFidelity, RefusesOptionsThatWouldBePassedOver) {
  const auto refuses = [](const char* option, const std::function<void(FidelityArguments&)>& give) {
    FidelityArguments arguments;
    give(arguments);
    EXPECT_THAT([&] { RunRecordedFidelity(arguments, Worlds({})); },
                ThrowsMessage<Error>(HasSubstr(std::string(option) + ": means nothing for a suite with a recording")));
  };
  refuses("--classifier", [](FidelityArguments& given) { given.classifier = "judge.safetensors"; });
  refuses("--reality", [](FidelityArguments& given) { given.reality = "out/earlier"; });
  refuses("--parts", [](FidelityArguments& given) { given.parts = {"open", "horizon"}; });
  refuses("--horizon-chunks", [](FidelityArguments& given) { given.horizon_chunks = 7; });
  FidelityArguments open;
  open.parts = {"open"};
  EXPECT_THAT([&] { RunRecordedFidelity(open, Worlds({})); }, ThrowsMessage<Error>(HasSubstr("wanted one of type evac")))
      << "which is what it does";
}

TEST(RecordedFidelity, RefusesFieldsOfTheSuiteThatWouldBePassedOver) {
  const auto refuses = [](const char* field, const std::function<void(Suite&)>& give) {
    Suite suite = Worlds({Evac("dream")});
    give(suite);
    EXPECT_THAT([&] { RunRecordedFidelity({}, suite); },
                ThrowsMessage<Error>(HasSubstr(
                    fmt::format("suite.yaml: field {}: means nothing for `evac fidelity` of recordings", field))));
  };
  refuses("still", [](Suite& suite) { suite.recorded_task.still.emplace(); });
  refuses("task", [](Suite& suite) { suite.recorded_task.name = "pour"; });
  refuses("workspace_m", [](Suite& suite) { suite.recorded_task.workspace_m.emplace(); });
  refuses("seeds", [](Suite& suite) { suite.seeds = {1, 2}; });
  refuses("initial_states of world dream", [](Suite& suite) { suite.worlds[0].initial_states = 2; });
}

TEST(Counterfactuals, OfATaskWhoseRubricNamesNoObjectAreRefusedBeforeAnythingSucceeded) {
  Task task;
  task.id = "wave";
  task.page_path = "wave.yaml";
  EXPECT_THAT([&] { Counterfactuals({}, {task}, 1); },
              ThrowsMessage<Error>(HasSubstr("wave.yaml: field rubric: no stage brings the gripper to a body")));
}

TEST(FidelityJudge, IsAskedWhetherItKnowsTheTasksBeforeThereAreClips) {
  Task task;
  task.id = "fold_laundry";
  EXPECT_NO_THROW(FidelityJudge("").RequireKnows({task})) << "nobody judges";
  const FidelityJudge judge(EVAC_SOURCE_DIR "/worldmodel/weights/desk/judge.safetensors");
  EXPECT_THAT([&] { judge.RequireKnows({task}); }, ThrowsMessage<Error>(HasSubstr("fold_laundry")));
  EXPECT_THROW(FidelityJudge("no_such_file.safetensors").RequireKnows({task}), Error);
}

}  // namespace
}  // namespace evac
