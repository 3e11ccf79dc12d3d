#include "policies/lcm_lane.h"

#include <algorithm>

#include "core/error.h"

namespace evac {
namespace {

/// The cameras of the task whose images the policy wants, as indices.
std::vector<std::size_t> WantedCameras(const Task& task, const PolicySpec& policy) {
  std::vector<std::size_t> wanted;
  for (std::size_t i = 0; policy.needs.contains("images") && i < task.cameras.size(); ++i) {
    const auto is_it = [&](const CameraNeed& need) { return need.name == task.cameras[i].name; };
    if (policy.cameras.empty() || std::any_of(policy.cameras.begin(), policy.cameras.end(), is_it)) wanted.push_back(i);
  }
  return wanted;
}

}  // namespace

void LcmLane::Begin(const Observation& observation, std::optional<int> jpeg_quality, double repeat_after_s) {
  answer.reset();
  gave_up = false;
  stale_replies = 0;
  header.request += 1;
  header.arms = ToWire(observation.arms);
  header.num_arms = static_cast<int>(header.arms.size());
  header.arms_are_commanded = observation.arms_are_commanded;
  images.clear();
  for (std::size_t i = 0; i < sent.size(); ++i) {
    if (sent[i] >= observation.images.size())
      throw InternalError("the observation lacks the image of camera {}", task.cameras[i].name);
    image_t& message = images.emplace_back();
    message.client = header.client;
    message.episode = header.episode;
    message.request = header.request;
    message.index = static_cast<int>(i);
    message.camera = task.cameras[i].name;
    PutImage(observation.images[sent[i]], jpeg_quality, message);
  }
  send_at = answerable_at = Clock::now();
  slept_s = 0;
  wait_s = repeat_after_s;
  sendings = 0;
}

void LcmLane::Started(const std::string& by, double repeat_after_s) {
  has_started = true;
  server = by;
  sendings = 0;
  wait_s = repeat_after_s;
  send_at = answerable_at = Clock::now();
  slept_s = 0;
}

double LcmLane::Waited_s() const {
  return std::max(0.0, std::chrono::duration<double>(Clock::now() - answerable_at).count() - slept_s);
}

LcmLane MakeLcmLane(const LcmEpisode& episode, const Task& task, const PolicySpec& policy) {
  LcmLane lane;
  lane.task = task;
  lane.sent = WantedCameras(task, policy);
  lane.task.cameras.clear();
  for (const std::size_t i : lane.sent) lane.task.cameras.push_back(task.cameras[i]);
  PutTask(lane.task, lane.start);
  lane.start.client = episode.client;
  lane.start.episode = episode.number;
  lane.start.lane = episode.lane;
  lane.start.seed = static_cast<std::int64_t>(episode.seed);
  lane.header.client = episode.client;
  lane.header.episode = episode.number;
  lane.header.request = -1;
  lane.header.task_id = task.id;
  lane.header.instruction = task.instruction;
  lane.header.cameras = lane.start.cameras;
  lane.header.num_images = static_cast<int>(lane.start.cameras.size());
  return lane;
}

}  // namespace evac
