#include "policies/learned_policy.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/zeros.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/geometry.h"
#include "core/weight_file.h"
#include "policies/gripper_poses.h"
#include "policies/learned_input.h"
#include "policies/learned_net.h"

namespace evac {
namespace {

constexpr double kGrasps = 0.5;  ///< a hand told to close further than this, or found so, has grasped

LearnedShape ShapeOf(const WeightFile& file) {
  if (file.Whole("chunk", 1, 1000) != kLearnedChunk)
    throw InvalidInput("{}: a policy of {} targets at once, wanted {}", file.name(), file.Text("chunk"), kLearnedChunk);
  LearnedShape shape{file.Names("tasks"), file.Names("cameras"), file.Names("arms"), file.Whole("height_px", 8, 4096),
                     file.Whole("width_px", 8, 4096)};
  if (shape.height_px % 8 != 0 || shape.width_px % 8 != 0)
    throw InvalidInput("{}: pictures of {}x{}, wanted multiples of 8", file.name(), shape.width_px, shape.height_px);
  return shape;
}

TakeParameter From(WeightFile& file) {
  return [&file](const std::string& key, const std::vector<std::int64_t>& shape) {
    const TensorView& view = file.Take(key, shape);
    at::Tensor copy = at::empty(shape, at::kFloat);
    std::memcpy(copy.data_ptr(), view.bytes.data(), view.bytes.size());
    return copy;
  };
}

bool Grasps(const ArmState& arm) { return arm.closure > kGrasps; }

std::string Stem(const std::filesystem::path& path) { return path.stem().string(); }

}  // namespace

struct LearnedPolicy::Network {
  Network(WeightFile& file, std::string stem)
      : name(std::move(stem)), shape(ShapeOf(file)), period_s(file.Number("period_s")), net(shape, From(file)) {
    for (const std::string& camera : shape.cameras) cameras.push_back(CameraOfCard(file, camera));
    file.RequireAllTaken();
    if (period_s <= 0) throw InvalidInput("{}: period_s is {}, wanted above 0", file.name(), period_s);
  }

  std::string name;
  LearnedShape shape;
  double period_s;
  std::vector<Camera> cameras;  ///< as in training
  LearnedNet net;
};

LearnedPolicy::LearnedPolicy(const std::filesystem::path& weights, int chunk_size, std::string as_task)
    : chunk_size_(chunk_size), as_task_(std::move(as_task)) {
  if (chunk_size < 1 || chunk_size > kLearnedChunk)
    throw InvalidInput("learned: found chunk size {}, wanted 1 … {}, what the network says at once", chunk_size,
                       kLearnedChunk);
  WeightFile file(weights, kLearnedFormat);
  network_ = std::make_unique<const Network>(file, Stem(weights));
  if (!as_task_.empty()) IndexOfTask(as_task_, "");
}

LearnedPolicy::~LearnedPolicy() = default;

PolicySpec LearnedPolicy::Spec() const {
  PolicySpec spec{.name = "learned", .checkpoint = network_->name};
  spec.arms = network_->shape.arms;
  spec.period_s = network_->period_s;
  spec.chunk_size = chunk_size_;
  for (const std::string& camera : network_->shape.cameras) spec.cameras.push_back({camera});  // of any size: made its own
  spec.needs = {"images", "arms", "whole_chunks"};
  return spec;
}

std::int64_t LearnedPolicy::IndexOfTask(const std::string& name, const char* remedy) const {
  const std::vector<std::string>& tasks = network_->shape.tasks;
  const auto known = std::find(tasks.begin(), tasks.end(), name);
  if (known == tasks.end())
    throw InvalidInput("learned@{}: task {} is none it learned, wanted one of {}{}", network_->name, name,
                       fmt::join(tasks, ", "), remedy);
  return known - tasks.begin();
}

void LearnedPolicy::Reset(SceneId scene, const Task& task, std::uint64_t) {
  const LearnedShape& shape = network_->shape;
  const std::int64_t task_index =
      as_task_.empty() ? IndexOfTask(task.id, "; --task takes any task for one of these") : IndexOfTask(as_task_, "");
  if (task.arms != shape.arms)
    throw InvalidInput("learned@{}: task {} has arms {}, in training they were {}", network_->name, task.id,
                       fmt::join(task.arms, ", "), fmt::join(shape.arms, ", "));
  if (std::abs(task.period_s - network_->period_s) > 1e-6)
    throw InvalidInput("learned@{}: task {} has a period of {} s, in training it was {} s", network_->name, task.id,
                       task.period_s, network_->period_s);
  Episode episode;
  episode.task = task;
  episode.task_index = task_index;
  for (const Camera& trained : network_->cameras) {
    const auto found =
        std::find_if(task.cameras.begin(), task.cameras.end(), [&](const Camera& c) { return c.name == trained.name; });
    if (found == task.cameras.end())
      throw InvalidInput("learned@{}: task {} has no camera {}", network_->name, task.id, trained.name);
    if (found->width_px < shape.width_px || found->height_px < shape.height_px)
      throw InvalidInput("learned@{}: camera {} of task {} has pictures of {}x{}, in training they were {}x{}",
                         network_->name, trained.name, task.id, found->width_px, found->height_px, shape.width_px,
                         shape.height_px);
    const std::string difference = CalibrationDifference(trained, *found, "in training");
    if (!difference.empty())
      throw InvalidInput("learned@{}: camera {} of task {} {}", network_->name, trained.name, task.id, difference);
    episode.views.push_back(static_cast<std::size_t>(found - task.cameras.begin()));
  }
  episodes_.insert_or_assign(scene, std::move(episode));
}

std::vector<Acted> LearnedPolicy::Act(std::span<const SceneObservation> batch) {
  std::vector<Acted> answers;
  for (const auto& [scene, observation] : batch) {
    const auto episode = episodes_.find(scene);
    if (episode == episodes_.end()) throw InternalError("learned was asked for scene {} before its Reset", scene);
    answers.push_back(Answer(episode->second, *observation));
  }
  return answers;
}

void LearnedPolicy::Begin(const Arms& arms, Episode& episode) {
  episode.told = arms;
  for (const ArmState& arm : arms) episode.grasped.push_back(Grasps(arm));
}

ActionChunk LearnedPolicy::Answer(Episode& episode, const Observation& observation) const {
  const at::NoGradGuard no_gradients;
  const LearnedShape& shape = network_->shape;
  const auto views = static_cast<std::int64_t>(episode.views.size()),
             arms = static_cast<std::int64_t>(shape.arms.size());
  if (episode.told.empty()) Begin(observation.arms, episode);
  at::Tensor bytes = at::empty({1, views, shape.height_px, shape.width_px, 3}, at::kByte);
  LearnedInput input{{},
                     at::empty({1, views, 3, 3}),
                     at::empty({1, views, 3}),
                     at::empty({1, arms, kArmNumbers}),
                     at::zeros({1, arms}),
                     at::zeros({1}, at::kLong)};
  for (std::int64_t v = 0; v < views; ++v) {
    const std::size_t from = episode.views[static_cast<std::size_t>(v)];
    cv::Mat picture(shape.height_px, shape.width_px, CV_8UC3, bytes[0][v].data_ptr());
    cv::resize(observation.images[from], picture, picture.size(), 0, 0, cv::INTER_AREA);
    const Camera& camera = episode.task.cameras[from];
    PutRays(camera, BaseFromCamera(camera, episode.told), input.rays[0][v].data_ptr<float>(),
            input.eyes[0][v].data_ptr<float>());
  }
  input.pictures = bytes.to(at::kFloat) / 127.5 - 1;
  for (std::int64_t a = 0; a < arms; ++a) {
    const auto at = static_cast<std::size_t>(a);
    PutArm(episode.told[at], input.arms[0][a].data_ptr<float>());
    input.grasped[0][a] = episode.grasped[at] ? 1 : 0;
  }
  input.task[0] = episode.task_index;
  const at::Tensor targets = network_->net(input).targets.contiguous();  // [1, chunk, A, kArmNumbers]
  ActionChunk chunk;
  for (int k = 0; k < chunk_size_; ++k) {
    Arms& target = chunk.targets.emplace_back();
    for (std::int64_t a = 0; a < arms; ++a) {
      ArmState arm = ArmFrom(targets[0][k][a].data_ptr<float>());
      arm.base_from_gripper = Inside(arm.base_from_gripper, episode.task.workspace_m);
      target.push_back(arm);
      if (Grasps(arm)) episode.grasped[static_cast<std::size_t>(a)] = true;
    }
  }
  episode.told = chunk.targets.back();
  return chunk;
}

}  // namespace evac
