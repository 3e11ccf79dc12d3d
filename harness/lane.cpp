#include "harness/lane.h"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string_view>

#include "core/check.h"
#include "core/error.h"
#include "harness/suite_hash.h"

namespace evac {
namespace {

std::string Jpeg(const cv::Mat& rgb) {
  if (rgb.empty()) return "";
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<unsigned char> bytes;
  cv::imencode(".jpg", bgr, bytes, {cv::IMWRITE_JPEG_QUALITY, 85});
  return std::string(bytes.begin(), bytes.end());
}

cv::Mat Enlarged(const cv::Mat& image, int scale) {
  cv::Mat large;
  cv::resize(image, large, {}, scale, scale, cv::INTER_NEAREST);
  return large;
}

bool IsCalled(const char* kind, const std::exception& error) {
  const auto* ours = dynamic_cast<const Error*>(&error);
  return ours != nullptr && std::string_view(ours->kind()) == kind;
}

}  // namespace

Lane::Lane(SceneId scene, Job job, const LaneOptions& options, Store& store)
    : scene_(scene), job_(std::move(job)), options_(options), store_(store), plan_(options.latency, options.chunk_size), still_(job_.task->still) {
  episode_.key = job_.key;
}

void Lane::Begin(Policy& policy, World& world) {
  const std::optional<WorldStep> first = ResetWorld(world);
  if (!first) return;
  Keep(*first);
  try {
    policy.Reset(scene_, *job_.task, job_.PolicySeed());
  } catch (const std::exception& error) {
    Fail({StopReason::kPolicyError, error.what()});
  }
}

std::optional<WorldStep> Lane::ResetWorld(World& world) try {
  WorldStep first = world.Reset(scene_, *job_.task, job_.initial, job_.WorldSeed());
  if (const auto wrong = WhatIsWrong(first.observation, *job_.task)) throw InternalError("{}", *wrong);
  return first;
} catch (const std::exception& error) {
  // A world reads where the episode begins: what the disk refuses then, or what was written to since the suite was
  // read, is no failure of the episode's.
  if (IsCalled(kStoreError, error) || IsCalled(kChangedError, error)) throw;
  const bool diverged = IsCalled(Name(StopReason::kDiverged), error);
  Fail({diverged ? StopReason::kDiverged : StopReason::kWorldError, error.what()});
  return std::nullopt;
}

/// The first frames: of the video, and of the scene where imagined episodes start.
void Lane::Keep(const WorldStep& first) {
  VideoOptions video = options_.video;
  video.period_s = job_.task->period_s;
  if (options_.film) video_.emplace(store_.VideoPath(job_.key), video);
  Append(first);
  if (!options_.keep_initial_scene) return;
  store_.AddInitialScene(job_.key.pair, {first.observation.images, first.observation.arms, job_.task->cameras});
}

void Lane::Command(const Acted& acted) {
  if (const Failure* failure = std::get_if<Failure>(&acted)) return Fail(*failure);
  const auto& answered = std::get<ActionChunk>(acted);
  if (const auto wrong = WhatIsWrong(answered, *job_.task, options_.policy_chunk_size)) {
    return Fail({StopReason::kPolicyError, fmt::format("chunk {}: {}", episode_.chunks + 1, *wrong)});
  }
  const std::vector<Arms> observed = ObservedSinceLastChunk();
  const Arms& last = episode_.commands.empty() ? observation().arms : episode_.commands.back();
  chunk_ = plan_.Execute(last, answered, job_.task->period_s);
  if (const auto rest = still_.Rest(last, chunk_.targets, observed)) Stop(StopReason::kStill, *rest);
}

void Lane::Observe(const Advanced& advanced) {
  if (const Failure* failure = std::get_if<Failure>(&advanced)) return Fail(*failure);
  const auto& steps = std::get<std::vector<WorldStep>>(advanced);
  if (steps.size() != chunk_.targets.size()) {
    return Fail({StopReason::kWorldError, fmt::format("the world answered {} targets with {} observations", chunk_.targets.size(), steps.size())});
  }
  for (std::size_t k = 0; k < steps.size(); ++k) {
    const Observation& observation = steps[k].observation;
    const bool seen = options_.film || k + 1 == steps.size();
    if (const auto wrong = seen ? WhatIsWrong(observation, *job_.task) : WhatIsWrongUnseen(observation, *job_.task)) {
      return Fail({StopReason::kWorldError, fmt::format("chunk {}, step {}: {}", episode_.chunks + 1, k + 1, *wrong)});
    }
    episode_.commands.push_back(chunk_.targets[k]);
    Append(steps[k]);
  }
  ++episode_.chunks;
  if (chunk_.ends_recording) {
    Stop(StopReason::kRecordingEnd, fmt::format("the recording ended after {} steps in {} chunks", episode_.commands.size(), episode_.chunks));
  } else if (episode_.chunks >= job_.task->max_chunks) {
    Stop(StopReason::kMaxChunks, still_.AtLimit());
  }
}

void Lane::Fail(const Failure& failure) {
  episode_.failure = failure.message;
  Stop(failure.stop, fmt::format("after {} chunks: {}", episode_.chunks, failure.message));
}

void Lane::Stop(StopReason stop, const std::string& sentence) {
  episode_.stop = stop;
  episode_.stop_reason = sentence;
  over_ = true;
}

void Lane::Append(const WorldStep& step) {
  if (!episode_.observations.empty()) episode_.observations.back().images.clear();  // they are in the video now
  episode_.observations.push_back(step.observation);
  privileged_.push_back(step.privileged);
  if (step.observation.images.empty()) return;
  last_frame_ = SideBySide(step.observation.images);
  if (video_) video_->Append(last_frame_);
}

/// Empty where the arms are only commanded: they say nothing about the gripper that the chunk does not say already.
std::vector<Arms> Lane::ObservedSinceLastChunk() const {
  const auto& observations = episode_.observations;
  if (observations.back().arms_are_commanded) return {};
  const std::size_t count = std::min(observations.size(), chunk_.targets.size() + 1);
  std::vector<Arms> observed;
  for (std::size_t i = observations.size() - count; i < observations.size(); ++i) observed.push_back(observations[i].arms);
  return observed;
}

EpisodeRecord Lane::Finish() {
  EpisodeRecord record;
  if (!last_frame_.empty()) {
    if (video_) record.video = video_->Finish();
    record.thumbnail_jpeg = Jpeg(Enlarged(last_frame_, options_.video.scale));
  }
  const bool has_physics = !privileged_.empty() && !privileged_.front().bodies.empty();
  if (has_physics) record.privileged = std::move(privileged_);
  if (!episode_.observations.empty()) episode_.observations.back().images.clear();
  record.episode = std::move(episode_);
  return record;
}

}  // namespace evac
