#include <gmock/gmock.h>

#include <chrono>
#include <fstream>

#include "core/error.h"
#include "tests/policies/wire_support.h"

namespace evac {
namespace {

using wire::Count;
using wire::Told;

/// A bad network between harness and policy: loses, doubles and delays messages, by its own seeded dice.
class BadNetwork {
 public:
  BadNetwork(const LcmAddress& harness, const LcmAddress& policy, double loss)
      : harness_(harness.url), policy_(policy.url), loss_(loss) {
    Carry(harness_, policy_, harness, policy, {"hello", "start", "observation", "image", "bye"});
    Carry(policy_, harness_, policy, harness, {"declaration", "started", "chunk"});
    thread_ = std::thread([this] {
      while (!stop_) {
        harness_.Handle(0.001);
        policy_.Handle(0.001);
      }
    });
  }
  ~BadNetwork() {
    stop_ = true;
    thread_.join();
  }

 private:
  struct Delayed {
    LcmLink* to = nullptr;
    std::string channel;
    std::vector<std::uint8_t> bytes;
  };

  void Carry(LcmLink& from, LcmLink& to, const LcmAddress& here, const LcmAddress& there,
             const std::vector<std::string>& messages) {
    for (const std::string& message : messages) {
      from.Subscribe(here.Channel(message), [this, &to, channel = there.Channel(message)](
                                                const std::string&, std::span<const std::uint8_t> bytes) {
        Pass({&to, channel, {bytes.begin(), bytes.end()}});
      });
    }
  }

  void Pass(Delayed message) {
    if (dice_.Uniform() < loss_) return;
    if (delayed_.to == nullptr && dice_.Uniform() < loss_)
      return void(delayed_ = std::move(message));  // overtaken by the next
    const int copies = dice_.Uniform() < loss_ ? 2 : 1;
    for (int i = 0; i < copies; ++i) message.to->PublishBytes(message.channel, message.bytes);
    if (delayed_.to == nullptr) return;
    delayed_.to->PublishBytes(delayed_.channel, delayed_.bytes);
    delayed_ = {};
  }

  LcmLink harness_, policy_;
  double loss_;
  SplitMix64 dice_{41};
  Delayed delayed_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

class WireFaultsTest : public wire::WireTest {
 protected:
  /// All scenes' targets, in order, over `requests` rounds.
  static std::vector<double> Heights(LcmPolicy& policy, int scenes, int requests) {
    const Task task = wire::TwoCameraTask();
    for (int scene = 0; scene < scenes; ++scene) policy.Reset(scene, task, 1);
    std::vector<double> heights;
    for (int request = 0; request < requests; ++request) {
      const Observation observation = wire::ObservationFor(task, static_cast<std::uint64_t>(request));
      std::vector<SceneObservation> batch;
      for (int scene = 0; scene < scenes; ++scene) batch.push_back({scene, &observation});
      for (const Acted& acted : policy.Act(batch)) {
        EXPECT_EQ(Told(acted), "chunk");
        if (wire::IsChunk(acted))
          heights.push_back(std::get<ActionChunk>(acted).targets[0][0].base_from_gripper.translation().z());
      }
    }
    return heights;
  }
};

TEST_F(WireFaultsTest, LossDoublesAndDelaysChangeNoAnswer) {
  const LcmAddress here = wire::OwnAddress("harness"), there = wire::OwnAddress("policy"),
                   straight = wire::OwnAddress("straight");
  wire::ProbePolicy lossy_probe, straight_probe;
  wire::Served lossy_server(lossy_probe, wire::ProbeSpec(), there),
      straight_server(straight_probe, wire::ProbeSpec(), straight);
  BadNetwork network(here, there, 0.15);
  LcmPolicy lossy({.address = here, .deadline_s = 120, .repeat_after_s = 0.03});
  LcmPolicy undisturbed({.address = straight, .deadline_s = 120, .repeat_after_s = 20});
  EXPECT_EQ(Heights(lossy, 3, 12), Heights(undisturbed, 3, 12));
  EXPECT_GE(Count(lossy.counters(), "repeats"), 10);
  for (const auto& [scene, seen] : lossy_probe.seen()) EXPECT_EQ(seen.observations.size(), 12u);
}

TEST_F(WireFaultsTest, EightLanesWithTwoImagesEachArriveAtTheFirstSending) {
  std::ifstream limit("/proc/sys/net/core/rmem_max");
  long buffer_bytes = 0;
  limit >> buffer_bytes;
  const bool has_room = buffer_bytes >= 4 << 20;  // else the system grants less than the 4 MiB asked for
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  for (const bool raw : {false, true}) {
    LcmPolicy policy(
        {.address = address, .deadline_s = 60, .repeat_after_s = has_room ? 55.0 : 0.5, .raw_images = raw});
    const Task task = wire::TwoCameraTask(128, 192);
    const Observation observation = wire::ObservationFor(task, 3);
    std::vector<SceneObservation> batch;
    for (int scene = 0; scene < 8; ++scene) {
      policy.Reset(scene, task, 1);
      batch.push_back({scene, &observation});
    }
    for (int request = 0; request < 5; ++request) {
      for (const Acted& acted : policy.Act(batch)) EXPECT_EQ(Told(acted), "chunk");
    }
    EXPECT_TRUE(!has_room || Count(policy.counters(), "repeats") == 0);
  }
}

TEST_F(WireFaultsTest, ABurstIsHeldToThePace) {
  using Clock = std::chrono::steady_clock;
  LcmLink link(wire::OwnAddress().url, {.bytes_per_s = 20e6, .burst_bytes = 64e3});
  const std::vector<std::uint8_t> megabyte(1'000'000);
  const Clock::time_point before = Clock::now();
  for (int i = 0; i < 4; ++i) link.PublishBytes("EVAC_pace", megabyte);
  const double passed_s = std::chrono::duration<double>(Clock::now() - before).count();
  EXPECT_GE(passed_s, 3 * 1e6 / 20e6);  // the fourth goes out when three have drained
}

TEST_F(WireFaultsTest, AHandlersExceptionComesOutOfHandleAndNotThroughC) {
  LcmLink link(wire::OwnAddress().url);
  link.Subscribe("EVAC_throw",
                 [](const std::string&, std::span<const std::uint8_t>) { throw InternalError("from a handler"); });
  link.PublishBytes("EVAC_throw", std::vector<std::uint8_t>(8));
  EXPECT_THROW(link.Handle(30), Error);
  link.Handle(0);  // it is still usable
}

}  // namespace
}  // namespace evac
