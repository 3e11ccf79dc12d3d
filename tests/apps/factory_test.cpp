#include "apps/factory.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"

namespace evac {
namespace {

/// Worlds refuse more than 256: every suite that says nothing of threads was refused there.
TEST(Factory, OnAMachineOfManyCoresAWorldTakesNoMoreThreadsThanItMay) {
  Suite suite;
  EXPECT_EQ(Threads(suite, 0), 1) << "it is not known";
  EXPECT_EQ(Threads(suite, 3), 3);
  EXPECT_EQ(Threads(suite, 256), 256);
  EXPECT_EQ(Threads(suite, 384), 256);
  suite.threads = 7;
  EXPECT_EQ(Threads(suite, 384), 7);
}

/// Rates of one checkpoint were kept under the name of another, without a word.
TEST(Factory, AJoinedPolicyThatDeclaresAnotherNameOrCheckpointIsSaidToDoSo) {
  SuitePolicy mine;
  mine.name = "mine";
  mine.checkpoint = "a";
  const auto said = [&](const std::string& name, const std::string& checkpoint) {
    return DeclaredOtherwise(mine, {.name = name, .checkpoint = checkpoint});
  };
  EXPECT_EQ(said("mine", "a"), "");
  EXPECT_EQ(said("", ""), "");
  EXPECT_EQ(said("mine", ""), "");
  EXPECT_EQ(said("mine", kDefaultCheckpoint), "") << "it says none";
  EXPECT_THAT(said("wander", "v1"), testing::StartsWith("policy mine@a declares itself as wander@v1;"));
  EXPECT_THAT(said("mine", "b"), testing::HasSubstr("mine@b"));
  mine.checkpoint = kDefaultCheckpoint;
  EXPECT_EQ(said("mine", "b"), "") << "the suite says none";
  mine.command = {"evac-policy", "hold"};
  EXPECT_EQ(said("wander", "v1"), "") << "evac started it, by the suite's own words";
}

/// Things that a page puts into each other are thrown apart as they settle.
class RestlessWorld : public World {
 public:
  explicit RestlessWorld(const char* kind) : kind_(kind) {}
  std::string Name() const override { return "real"; }
  WorldStep Reset(SceneId, const Task&, const InitialState&, std::uint64_t) override {
    throw InternalError("physics diverged before 0.10 s").Called(kind_);
  }
  std::vector<Advanced> Advance(std::span<const SceneChunk>) override { return {}; }

 private:
  const char* kind_;
};

/// It was an internal error, and the advice to go on once that was mended: every try ended the same.
TEST(CheckStart, PhysicsThatDivergesAsAStateSettlesIsThePagesMistake) {
  Task task;
  task.page_path = "scenes/heap.yaml";
  const auto error_of = [&](const char* kind) {
    RestlessWorld world(kind);
    try {
      CheckStart(world, task, {"41-0003", 9});
    } catch (const Error& error) {
      return error;
    }
    return Error(ExitCode::kOk, "it began");
  };
  const Error diverged = error_of("diverged");
  EXPECT_EQ(diverged.exit_code(), ExitCode::kInvalidInput);
  EXPECT_THAT(diverged.what(), testing::AllOf(testing::HasSubstr("scenes/heap.yaml: "), testing::HasSubstr("41-0003"),
                                              testing::HasSubstr("physics diverged before 0.10 s")));
  EXPECT_EQ(error_of("").exit_code(), ExitCode::kInternal) << "what else fails is no page's";
}

}  // namespace
}  // namespace evac
