#include "worldmodel/evac_world.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <opencv2/imgproc.hpp>
#include <thread>
#include <utility>

#include "core/error.h"
#include "worldmodel/nn/threads.h"

namespace evac {
namespace {

void CheckFits(const Task& task, const InitialScene& scene, const std::string& world) {
  if (scene.arms.size() != task.arms.size())
    throw InvalidInput("world {}: the first frame of task {} shows {} arms, wanted {}", world, task.id,
                       scene.arms.size(), task.arms.size());
  bool fits = scene.cameras.size() == task.cameras.size();
  for (std::size_t i = 0; fits && i < task.cameras.size(); ++i) {
    const Camera &seen = scene.cameras[i], &asked = task.cameras[i];
    fits = seen.name == asked.name && seen.width_px == asked.width_px && seen.height_px == asked.height_px;
  }
  if (!fits)
    throw InvalidInput("world {}: the first frame of task {} was not taken by the task's cameras", world, task.id);
}

/// At most `size` targets each, in order.
std::vector<std::span<const Arms>> InPieces(std::span<const Arms> targets, std::size_t size) {
  std::vector<std::span<const Arms>> pieces;
  for (std::size_t from = 0; from < targets.size(); from += size)
    pieces.push_back(targets.subspan(from, std::min(size, targets.size() - from)));
  return pieces;
}

cv::Mat OfSize(const cv::Mat& picture, const Camera& camera) {
  const cv::Size size(camera.width_px, camera.height_px);
  if (picture.size() == size) return picture;
  cv::Mat resized;
  const bool shrinks = size.width < picture.cols || size.height < picture.rows;
  cv::resize(picture, resized, size, 0, 0, shrinks ? cv::INTER_AREA : cv::INTER_LINEAR);
  return resized;
}

/// What was imagined, as the task's cameras would have taken it.
void Show(const Pictures& pictures, std::span<const Arms> targets, const std::vector<Camera>& cameras,
          std::vector<WorldStep>& steps) {
  for (std::size_t k = 0; k < targets.size(); ++k) {
    WorldStep& step = steps.emplace_back();
    step.observation.arms = targets[k];
    step.observation.arms_are_commanded = true;
    for (std::size_t v = 0; v < cameras.size(); ++v)
      step.observation.images.push_back(OfSize(pictures[k][v], cameras[v]));
  }
}

}  // namespace

void CheckViews(const Task& task, int views, const std::string& who) {
  if (task.cameras.size() == static_cast<std::size_t>(views)) return;
  throw InvalidInput("{}: task {} has {} cameras, the network imagines {} views", who, task.id, task.cameras.size(),
                     views);
}

EvacWorld::EvacWorld(Imaginer imaginer, FirstScene first_scene, EvacWorldOptions options)
    : imaginer_(std::move(imaginer)), first_scene_(std::move(first_scene)), options_(std::move(options)) {
  if (options_.threads < 1 || options_.threads > 256)
    throw InvalidInput("world {}: found threads {}, wanted 1 … 256", options_.name, options_.threads);
}

WorldStep EvacWorld::Reset(SceneId scene, const Task& task, const InitialState& initial, std::uint64_t seed) {
  if (std::abs(task.period_s - options_.period_s) > 1e-6)
    throw InvalidInput("world {}: its frames are {:.4g} s apart, those of task {} {:.4g} s", options_.name,
                       options_.period_s, task.id, task.period_s);
  CheckViews(task, imaginer_.config().views, "world " + options_.name);
  const InitialScene start = first_scene_(task, initial);
  CheckFits(task, start, options_.name);
  const nn::LibraryThreads threads(ThreadsPerScene());
  places_.insert_or_assign(scene, Place{imaginer_.Begin(start, seed), task.cameras});
  return {{.images = start.images, .arms = start.arms, .arms_are_commanded = true}, {}};
}

std::vector<Advanced> EvacWorld::Advance(std::span<const SceneChunk> batch) {
  return ForEach(batch, [this](Place& place, const ActionChunk& chunk) -> Advanced {
    std::vector<WorldStep> steps;
    for (const std::span<const Arms> targets : InPieces(chunk.targets, imaginer_.chunk())) {
      const auto memory = imaginer_.Remember(place.scene);                          // sparse history, newest last
      const auto conditioning = imaginer_.Condition(place.scene, memory, targets);  // deltas, pose maps, rays
      ChunkLatents latents = imaginer_.Denoise(place.scene, conditioning);          // from noise that is ours alone
      if (const auto wrong = WhatIsWrong(latents)) return Failure{StopReason::kDiverged, *wrong};
      const Pictures pictures = imaginer_.Decode(latents);                   // the new frames only
      imaginer_.Append(place.scene, targets, std::move(latents), pictures);  // nothing is encoded twice
      Show(pictures, targets, place.cameras, steps);
    }
    return steps;
  });
}

std::vector<Advanced> EvacWorld::ForEach(std::span<const SceneChunk> batch,
                                         const std::function<Advanced(Place&, const ActionChunk&)>& imagine) {
  std::vector<Place*> places;
  for (const SceneChunk& asked : batch) {
    const auto found = places_.find(asked.scene);
    if (found == places_.end()) throw InternalError("world {}: scene {} was never reset", options_.name, asked.scene);
    places.push_back(&found->second);
  }
  std::vector<Advanced> answers(batch.size());
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    nn::UseLibraryThreadsHere(ThreadsPerScene());
    for (std::size_t i = next++; i < batch.size(); i = next++) {
      try {
        answers[i] = imagine(*places[i], *batch[i].chunk);
      } catch (const std::exception& error) {
        answers[i] = Failure{StopReason::kWorldError, error.what()};
      }
    }
  };
  const nn::LibraryThreads threads(ThreadsPerScene());
  const std::size_t at_once = options_.all_threads_per_scene ? 1 : static_cast<std::size_t>(options_.threads);
  std::vector<std::jthread> workers;
  for (std::size_t i = 1; i < std::min(at_once, batch.size()); ++i) workers.emplace_back(work);
  work();
  workers.clear();
  return answers;
}

}  // namespace evac
