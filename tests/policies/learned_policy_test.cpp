#include "policies/learned_policy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "core/check.h"
#include "core/error.h"
#include "core/geometry.h"
#include "core/seed.h"
#include "core/tensor_file.h"
#include "policies/learned_input.h"
#include "policies/learned_net.h"
#include "tests/policies/wire_support.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::ThrowsMessage;

/// What a policy was trained with, and what it is then asked to do: the same.
Task Trained() { return wire::TwoCameraTask(16, 24); }

TensorMetadata CardOf(const Task& task) {
  TensorMetadata card = {{"format", kLearnedFormat},
                         {"tasks", "take_bottle,take_toast"},
                         {"cameras", "head,hand_right"},
                         {"arms", "right"},
                         {"chunk", "16"},
                         {"period_s", "0.1"},
                         {"height_px", "16"},
                         {"width_px", "24"}};
  for (const Camera& camera : task.cameras) card["camera." + camera.name] = CardLine(camera);
  return card;
}

/// The same cameras, with pictures of another size.
Task TrainedAt(int width_px, int height_px) {
  Task task = Trained();
  for (Camera& camera : task.cameras) camera = Resized(camera, width_px, height_px);
  return task;
}

/// Weights that no training made.
fs::path Weights(const fs::path& path, const TensorMetadata& card = CardOf(Trained())) {
  std::deque<std::vector<float>> numbers;
  std::vector<TensorView> views;
  SplitMix64 random(3);
  const TakeParameter take = [&](const std::string& key, const std::vector<std::int64_t>& shape) {
    TensorView view{{key, TensorType::kF32, shape}, {}};
    std::vector<float>& values = numbers.emplace_back(view.ByteCount() / sizeof(float));
    for (float& value : values) value = static_cast<float>(random.Uniform(-0.1, 0.1));
    view.bytes = std::as_bytes(std::span(values));
    views.push_back(view);
    return at::Tensor();
  };
  LearnedNet({{"take_bottle", "take_toast"}, {"head", "hand_right"}, {"right"}, 16, 24}, take);
  WriteTensorFile(path, views, card);
  return path;
}

ActionChunk Ask(Policy& policy, const Observation& observation, SceneId scene = 0) {
  const SceneObservation asked{scene, &observation};
  return std::get<ActionChunk>(policy.Act({&asked, 1}).front());
}

std::vector<double> Numbers(const ActionChunk& chunk) {
  std::vector<double> numbers;
  for (const Arms& target : chunk.targets) {
    const auto& pose = target.back().base_from_gripper.matrix();
    numbers.insert(numbers.end(), pose.data(), pose.data() + 16);
    numbers.push_back(target.back().closure);
  }
  return numbers;
}

TEST(LearnedInput, AnArmSurvivesBecomingNumbers) {
  ArmState arm;
  arm.base_from_gripper =
      Eigen::Translation3d(0.4, -0.1, 0.2) * Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, 2, -1).normalized());
  arm.closure = 0.7;
  float numbers[kArmNumbers];
  PutArm(arm, numbers);
  const ArmState back = ArmFrom(numbers);
  EXPECT_TRUE(back.base_from_gripper.isApprox(arm.base_from_gripper, 1e-6));
  EXPECT_NEAR(back.closure, 0.7, 1e-6);
}

TEST(LearnedInput, WhateverANetworkSaysBecomesARotation) {
  const float numbers[kArmNumbers] = {0, 0, 0, 0.9F, 0.2F, -0.1F, 0.3F, 1.1F, 0.4F, 1.7F};
  const ArmState arm = ArmFrom(numbers);
  EXPECT_TRUE((arm.base_from_gripper.linear() * arm.base_from_gripper.linear().transpose()).isIdentity(1e-6));
  EXPECT_NEAR(arm.base_from_gripper.linear().determinant(), 1, 1e-6);
  EXPECT_EQ(arm.closure, 1);
}

TEST(LearnedInput, RaysOfACameraMeetWhatItSees) {
  const Camera camera = Trained().cameras[0];
  Eigen::Isometry3d base_from_camera(Eigen::Translation3d(0.5, 0.1, 0.6) *
                                     Eigen::AngleAxisd(3.0, Eigen::Vector3d::UnitX()));
  float rays[9], eye[3];
  PutRays(camera, base_from_camera, rays, eye);
  const Eigen::Vector3d point(0.45, 0.2, 0);
  const Eigen::Vector2d px = *Project(camera, base_from_camera.inverse() * point);
  const Eigen::Matrix3f to_ray = Eigen::Map<Eigen::Matrix<float, 3, 3, Eigen::RowMajor>>(rays);
  const Eigen::Vector3f ray =
      to_ray * Eigen::Vector3d(px.x() / camera.width_px, px.y() / camera.height_px, 1).cast<float>();
  EXPECT_TRUE(ray.normalized().isApprox((point - base_from_camera.translation()).normalized().cast<float>(), 1e-5F));
  EXPECT_FLOAT_EQ(eye[2], 0.6F);
}

TEST(LearnedPolicy, AnswersTargetsThatAWorldTakes) {
  const TempFolder folder;
  LearnedPolicy policy(Weights(folder / "step.safetensors"), 8);
  const Task task = Trained();
  policy.Reset(0, task, 1);
  const ActionChunk chunk = Ask(policy, wire::ObservationFor(task, 5));
  EXPECT_EQ(chunk.targets.size(), 8U);
  EXPECT_EQ(WhatIsWrong(chunk, task, 8), std::nullopt);
}

TEST(LearnedPolicy, ItsAnswerIsAFunctionOfWhatItSawSinceReset) {
  const TempFolder folder;
  LearnedPolicy policy(Weights(folder / "step.safetensors"), 8);
  const Task task = Trained();
  const Observation first = wire::ObservationFor(task, 5), second = wire::ObservationFor(task, 6);
  policy.Reset(0, task, 1);
  policy.Reset(1, task, 1);
  const std::vector<double> alone = Numbers(Ask(policy, first));
  EXPECT_NE(Numbers(Ask(policy, second)), alone);
  EXPECT_EQ(Numbers(Ask(policy, first, 1)), alone) << "scenes know nothing of each other";
  policy.Reset(0, task, 1);
  EXPECT_EQ(Numbers(Ask(policy, first)), alone) << "nothing is left of the episode before";
}

TEST(LearnedPolicy, DoesTheSameWhereNobodyMeasuresTheArms) {
  const TempFolder folder;
  LearnedPolicy policy(Weights(folder / "step.safetensors"), 8);
  const Task task = Trained();
  const Observation first = wire::ObservationFor(task, 5);
  Observation measured = wire::ObservationFor(task, 6), commanded = measured;
  measured.arms[0].base_from_gripper.translation() += Eigen::Vector3d(0.01, 0, 0.02);
  measured.arms[0].closure = 0.4;  // of a hand that holds something
  commanded.arms_are_commanded = true;
  policy.Reset(0, task, 1);
  policy.Reset(1, task, 1);
  const ActionChunk told = Ask(policy, first);
  Ask(policy, first, 1);
  commanded.arms = told.targets.back();
  EXPECT_EQ(Numbers(Ask(policy, measured)), Numbers(Ask(policy, commanded, 1)));
}

TEST(LearnedPolicy, AHandThatBeginsClosedHasGraspedAsInTraining) {
  const TempFolder folder;
  LearnedPolicy policy(Weights(folder / "step.safetensors"), 8);
  const auto begun = [&](double closure) {
    Observation first = wire::ObservationFor(Trained(), 5);
    first.arms[0].closure = closure;
    policy.Reset(0, Trained(), 1);
    return Numbers(Ask(policy, first));
  };
  const auto farthest = [](const std::vector<double>& a, const std::vector<double>& b) {
    double most = 0;
    for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, std::abs(a[i] - b[i]));
    return most;
  };
  const std::vector<double> open = begun(0.5), closed = begun(0.50001);
  EXPECT_LT(farthest(begun(0.49999), open), 1e-4) << "its answer follows the closure without a jump";
  EXPECT_GT(farthest(open, closed), 1e-3) << "but for what it takes to be held";
}

TEST(LearnedPolicy, DeclaresWhatItsCardSays) {
  const TempFolder folder;
  const LearnedPolicy policy(Weights(folder / "step_0500.safetensors"), 8);
  const PolicySpec spec = policy.Spec();
  EXPECT_EQ(spec.checkpoint, "step_0500");
  EXPECT_EQ(spec.chunk_size, 8);
  EXPECT_TRUE(Compare(HarnessSpec(Trained(), 8), spec).empty());
  const auto complaint = [&](Task task, int chunk_size) {
    std::string text;
    for (const SpecMismatch& row : Compare(HarnessSpec(task, chunk_size), spec)) text += row.field + " ";
    return text;
  };
  Task other = Trained();
  other.period_s = 0.05;
  EXPECT_EQ(complaint(other, 8), "period ");
  other = Trained();
  other.arms = {"left", "right"};
  EXPECT_EQ(complaint(other, 8), "arms ");
  EXPECT_EQ(complaint(TrainedAt(48, 32), 8), "") << "larger pictures are made its own size";
  other = Trained();
  other.cameras.pop_back();
  EXPECT_EQ(complaint(other, 8), "cameras ");
  EXPECT_EQ(complaint(Trained(), 16), "chunk_size ");
}

TEST(LearnedPolicy, RefusesTasksCamerasAndRobotsItWasNotTrainedFor) {
  const TempFolder folder;
  LearnedPolicy policy(Weights(folder / "step.safetensors"), 8);
  const auto complaint = [&](const Task& task) {
    try {
      policy.Reset(0, task, 1);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("nothing");
  };
  EXPECT_EQ(complaint(Trained()), "nothing");
  Task task = Trained();
  task.id = "take_ham";
  EXPECT_THAT(complaint(task), HasSubstr("task take_ham is none it learned, wanted one of take_bottle, take_toast"));
  task = Trained();
  task.cameras[1].mount_from_camera.translation().x() += 0.1;
  EXPECT_THAT(complaint(task),
              HasSubstr("camera hand_right of task take_bottle stands 0.100 m and 0.0 degrees from where it stood"));
  task = Trained();
  task.cameras[0].fx_px *= 2;
  EXPECT_THAT(
      complaint(task),
      HasSubstr("camera head of task take_bottle has a focal length of 5.042 picture widths, in training 2.521"));
  task = Trained();
  task.cameras[1].fy_px *= 2;
  EXPECT_THAT(complaint(task), HasSubstr("picture heights, in training"));
  EXPECT_EQ(complaint(TrainedAt(48, 32)), "nothing") << "larger pictures are made its own size";
  EXPECT_THAT(complaint(TrainedAt(12, 8)),
              HasSubstr("camera head of task take_bottle has pictures of 12x8, in training they were 24x16"));
  task = Trained();
  task.cameras.pop_back();
  EXPECT_THAT(complaint(task), HasSubstr("has no camera hand_right"));
  task = Trained();
  task.arms = {"left", "right"};
  EXPECT_THAT(complaint(task), HasSubstr("has arms left, right, in training they were right"));
  task = Trained();
  task.period_s = 0.2;
  EXPECT_THAT(complaint(task), HasSubstr("has a period of 0.2 s, in training it was 0.1 s"));
}

TEST(LearnedPolicy, AnyTaskIsTakenForTheOneThatItIsToldToActIn) {
  const TempFolder folder;
  const fs::path weights = Weights(folder / "step.safetensors");
  Task recorded = Trained(), toast = Trained();
  recorded.id = "327-648642";
  toast.id = "take_toast";
  const Observation seen = wire::ObservationFor(Trained(), 5);
  const auto does = [&](LearnedPolicy policy, const Task& task) {
    policy.Reset(0, task, 1);
    return Numbers(Ask(policy, seen));
  };
  EXPECT_EQ(does(LearnedPolicy(weights, 8, "take_toast"), recorded), does(LearnedPolicy(weights, 8), toast));
  EXPECT_NE(does(LearnedPolicy(weights, 8, "take_toast"), recorded), does(LearnedPolicy(weights, 8), Trained()));
  EXPECT_THAT([&] { LearnedPolicy(weights, 8).Reset(0, recorded, 1); },
              ThrowsMessage<Error>(HasSubstr("; --task takes any task for one of these")));
  EXPECT_THAT([&] { LearnedPolicy(weights, 8, "take_ham"); },
              ThrowsMessage<Error>(HasSubstr("task take_ham is none it learned")));
}

TEST(LearnedPolicy, WeightsThatDoNotFitAreRefusedWithWhatDiffers) {
  const TempFolder folder;
  const auto complaint = [&](const char* field, const std::string& value) {
    TensorMetadata card = CardOf(Trained());
    card[field] = value;
    try {
      LearnedPolicy(Weights(folder / "bad.safetensors", card), 8);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string("nothing");
  };
  EXPECT_THAT(complaint("format", "evac-classifier 1"), HasSubstr("wanted 'evac-policy-learned 1'"));
  EXPECT_THAT(complaint("chunk", "8"), HasSubstr("a policy of 8 targets at once, wanted 16"));
  EXPECT_THAT(complaint("arms", "left,right"), HasSubstr("wanted F32"));
  EXPECT_THAT(complaint("camera.head", "base 1 2 3"),
              HasSubstr("card field 'camera.head': found 'base 1 2 3', wanted a mount and 16"));
  EXPECT_THAT(complaint("period_s", "0"), HasSubstr("period_s is 0, wanted above 0"));
  EXPECT_THROW(LearnedPolicy(folder / "none.safetensors", 8), Error);
  EXPECT_THAT([&] { LearnedPolicy(Weights(folder / "step.safetensors"), 17); },
              ThrowsMessage<Error>(HasSubstr("found chunk size 17, wanted 1 … 16")));
}

}  // namespace
}  // namespace evac
