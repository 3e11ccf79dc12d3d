#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <functional>
#include <mutex>
#include <thread>

#include "core/seed.h"
#include "policies/lcm_policy.h"
#include "policies/messages.h"
#include "policies/policy_server.h"

namespace evac::wire {

/// An address no other test, and no other run of this one, uses.
inline LcmAddress OwnAddress(const std::string& suffix = "") {
  const testing::TestInfo& test = *testing::UnitTest::GetInstance()->current_test_info();
  return LcmAddress::For(fmt::format("{} {}.{} {}", getpid(), test.test_suite_name(), test.name(), suffix));
}

inline Task TwoCameraTask(int height_px = 32, int width_px = 48) {
  Task task;
  task.id = "take_bottle";
  task.instruction = "take the bottle out of the box";
  for (const char* name : {"head", "hand_right"}) {
    task.cameras.push_back({.name = name,
                            .width_px = width_px,
                            .height_px = height_px,
                            .fx_px = 60.5,
                            .fy_px = 61.5,
                            .cx_px = 24,
                            .cy_px = 16.25});
  }
  task.cameras[1].mount = Mount::kRightGripper;
  task.cameras[1].mount_from_camera.translation() = Eigen::Vector3d(0.1, 0, 0.05);
  return task;
}

/// Noise: the hardest picture for JPEG, and different for every seed.
inline cv::Mat Noise(int height_px, int width_px, std::uint64_t seed) {
  cv::Mat image(height_px, width_px, CV_8UC3);
  SplitMix64 random(seed);
  for (int i = 0; i < height_px * width_px * 3; ++i) image.data[i] = static_cast<std::uint8_t>(random.Below(256));
  return image;
}

inline Observation ObservationFor(const Task& task, std::uint64_t seed) {
  Observation observation;
  for (const Camera& camera : task.cameras)
    observation.images.push_back(Noise(camera.height_px, camera.width_px, seed++));
  observation.arms.resize(task.arms.size());
  observation.arms[0].base_from_gripper.translation() =
      Eigen::Vector3d(0.3, 0.01 * static_cast<double>(seed % 100), 0.2);
  observation.arms[0].closure = 0.25;
  return observation;
}

/// Answers, `chunk_size` times, where the arm is, raised by a centimetre per request it has had in the episode: an
/// answer that was computed twice, or for another request, shows. Keeps what it was shown. Instructions make it
/// misbehave.
class ProbePolicy : public Policy {
 public:
  struct Seen {
    Task task;
    std::uint64_t seed = 0;
    std::vector<Observation> observations;
  };

  explicit ProbePolicy(int chunk_size = 2) : chunk_size_(chunk_size) {}

  std::string Name() const override { return "probe"; }

  void Reset(SceneId scene, const Task& task, std::uint64_t seed) override {
    if (task.instruction == "refuse") throw std::runtime_error("I do not know how");
    const std::lock_guard lock(mutex_);
    seen_[scene] = {task, seed, {}};
  }

  std::vector<Acted> Act(std::span<const SceneObservation> batch) override {
    std::vector<Acted> answers;
    for (const SceneObservation& asked : batch) answers.push_back(Answer(asked));
    return answers;
  }

  std::map<SceneId, Seen> seen() const {
    const std::lock_guard lock(mutex_);
    return seen_;
  }

 private:
  Acted Answer(const SceneObservation& asked) {
    const std::lock_guard lock(mutex_);
    Seen& seen = seen_.at(asked.scene);
    seen.observations.push_back(*asked.observation);
    if (seen.task.instruction == "throw") throw std::runtime_error("out of memory on the policy's side");
    if (seen.task.instruction == "give up") return Failure{StopReason::kPolicyError, "I see nothing"};
    Arms target = asked.observation->arms;
    if (seen.task.instruction == "nan") target[0].base_from_gripper.translation().y() = std::nan("");
    target[0].base_from_gripper.translation().z() += 0.01 * static_cast<double>(seen.observations.size());
    return ActionChunk{.targets = std::vector<Arms>(chunk_size_, target)};
  }

  std::size_t chunk_size_;
  mutable std::mutex mutex_;
  std::map<SceneId, Seen> seen_;
};

inline PolicySpec ProbeSpec(int chunk_size = 2) {
  return {.name = "probe", .checkpoint = "c1", .chunk_size = chunk_size, .needs = {"images", "arms"}};
}

/// A policy served by a thread, as long as this lives.
class Served {
 public:
  Served(Policy& policy, const PolicySpec& spec, const LcmAddress& address) : server_(policy, spec, address) {
    thread_ = std::thread([this] { server_.Run(); });
  }
  ~Served() { Stop(); }

  void Stop() {
    server_.Stop();
    if (thread_.joinable()) thread_.join();
  }

  /// Stops it first.
  Counters counters() {
    Stop();
    return server_.counters();
  }

 private:
  PolicyServer server_;
  std::thread thread_;
};

/// Bytes on the wire that no honest server would send: acknowledges starts, and hands every observation to `reply`.
class RawServer {
 public:
  using Reply = std::function<void(LcmLink& link, const observation_t& header)>;

  RawServer(LcmAddress address, Reply reply)
      : address_(std::move(address)), link_(address_.url), reply_(std::move(reply)) {
    link_.Subscribe(address_.Channel("start"), [this](const std::string&, std::span<const std::uint8_t> bytes) {
      const auto start = Decoded<episode_start_t>(bytes);
      episode_started_t started;
      started.client = start->client;
      started.server = "raw";
      started.episode = start->episode;
      link_.Publish(address_.Channel("started"), started);
    });
    link_.Subscribe(address_.Channel("observation"), [this](const std::string&, std::span<const std::uint8_t> bytes) {
      reply_(link_, *Decoded<observation_t>(bytes));
    });
    thread_ = std::thread([this] {
      while (!stop_) link_.Handle(0.01);
    });
  }
  ~RawServer() {
    stop_ = true;
    thread_.join();
  }

  /// What an honest server would answer: one target, where the arm is.
  static chunk_t Honest(const observation_t& header) {
    chunk_t reply{};
    reply.client = header.client;
    reply.server = "raw";
    reply.episode = header.episode;
    reply.request = header.request;
    reply.num_targets = 1;
    reply.num_arms = header.num_arms;
    reply.targets = {header.arms};
    return reply;
  }

 private:
  LcmAddress address_;
  LcmLink link_;
  Reply reply_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

inline bool IsChunk(const Acted& acted) { return std::holds_alternative<ActionChunk>(acted); }

/// The failure's "policy_error: message", or "chunk".
inline std::string Told(const Acted& acted) {
  const auto* failure = std::get_if<Failure>(&acted);
  return failure == nullptr ? "chunk" : fmt::format("{}: {}", Name(failure->stop), failure->message);
}

inline std::int64_t Count(const Counters& counters, const std::string& name) {
  const auto found = counters.find(name);
  return found == counters.end() ? 0 : found->second;
}

/// Every test of the wire: needs multicast on this machine.
class WireTest : public testing::Test {
 protected:
  void SetUp() override {
    if (const auto wrong = WhatIsWrongWithLcm()) GTEST_SKIP() << *wrong;
  }

  /// Asks for scenes that were reset, all at once.
  static std::vector<Acted> Ask(LcmPolicy& policy, const std::vector<SceneId>& scenes,
                                const Task& task = TwoCameraTask()) {
    const Observation observation = ObservationFor(task, 7);
    std::vector<SceneObservation> batch;
    for (const SceneId scene : scenes) batch.push_back({scene, &observation});
    return policy.Act(batch);
  }
};

}  // namespace evac::wire
