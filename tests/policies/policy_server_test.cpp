#include "policies/policy_server.h"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>

#include <stdexcept>

#include "core/file.h"
#include "policies/messages.h"
#include "tests/policies/wire_support.h"
#include "tests/support/child.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using wire::Count;
using wire::Told;

episode_start_t StartOf(const Task& task, const std::string& client, std::int64_t episode, int lane) {
  episode_start_t start;
  PutTask(task, start);
  start.client = client;
  start.episode = episode;
  start.lane = lane;
  start.seed = 1;
  return start;
}

/// Hears what comes until it is true. @throws std::runtime_error where nothing comes that makes it so.
template <typename IsTrue>
void HearUntil(LcmLink& link, const IsTrue& is_true) {
  for (int waits = 0; !is_true(); ++waits) {
    if (waits == 1200) throw std::runtime_error("what the test waits for never came");
    link.Handle(0.1);
  }
}

/// A harness of bare messages: what the server sends is kept as bytes.
class BareClient {
 public:
  explicit BareClient(LcmAddress address, std::string name = "bare")
      : address_(std::move(address)), link_(address_.url), name_(std::move(name)) {
    Keep("chunk", chunks);
    Keep("started", started);
  }

  void Start(std::int64_t episode, int lane, const Task& task) {
    const std::size_t before = started.size();
    link_.Publish(address_.Channel("start"), StartOf(task, name_, episode, lane));
    HearUntil(link_, [&] { return started.size() > before; });
  }

  observation_t Header(std::int64_t episode, std::int64_t request, const Observation& observation) const {
    observation_t header{};
    header.client = name_;
    header.episode = episode;
    header.request = request;
    header.arms = ToWire(observation.arms);
    header.num_arms = static_cast<int>(header.arms.size());
    header.num_images = static_cast<int>(observation.images.size());
    header.cameras.resize(observation.images.size(), ToWire(Camera()));
    return header;
  }

  image_t Image(std::int64_t episode, std::int64_t request, int index, const cv::Mat& rgb) const {
    image_t image{};
    image.client = name_;
    image.episode = episode;
    image.request = request;
    image.index = index;
    image.camera = index == 0 ? "head" : "hand_right";
    PutImage(rgb, std::nullopt, image);
    return image;
  }

  template <typename Message>
  void Send(const std::string& message, const Message& content) {
    link_.Publish(address_.Channel(message), content);
  }

  void SendBytes(const std::string& message, std::span<const std::uint8_t> bytes) {
    link_.PublishBytes(address_.Channel(message), bytes);
  }

  chunk_t NextChunk() {
    const std::size_t before = chunks.size();
    HearUntil(link_, [&] { return chunks.size() > before; });
    return chunks.back();
  }

  std::vector<chunk_t> chunks;
  std::vector<episode_started_t> started;

 private:
  template <typename Message>
  void Keep(const std::string& message, std::vector<Message>& mine) {
    link_.Subscribe(address_.Channel(message), [this, &mine](const std::string&, auto bytes) {
      const auto decoded = Decoded<Message>(bytes);
      if (decoded->client == name_) mine.push_back(*decoded);
    });
  }

  LcmAddress address_;
  LcmLink link_;
  std::string name_;
};

class PolicyServerTest : public wire::WireTest {
 protected:
  const Task task_ = wire::TwoCameraTask();
  const Observation observation_ = wire::ObservationFor(task_, 3);
};

TEST_F(PolicyServerTest, ARepeatedRequestIsAnsweredFromTheCacheWithTheSameTargets) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  BareClient client(address);
  client.Start(0, 0, task_);
  const auto ask = [&](std::int64_t request) {
    client.Send("observation", client.Header(0, request, observation_));
    for (int i = 0; i < 2; ++i) client.Send("image", client.Image(0, request, i, observation_.images[i]));
    return client.NextChunk();
  };
  const chunk_t first = ask(0), next = ask(1), again = ask(0);
  EXPECT_EQ(first.error, "");
  EXPECT_EQ(again.request, 0);
  EXPECT_EQ(again.targets[0][0].position_m[2], first.targets[0][0].position_m[2]);
  EXPECT_NE(next.targets[0][0].position_m[2], first.targets[0][0].position_m[2]);
  EXPECT_GT(again.sequence, next.sequence);
  EXPECT_EQ(probe.seen().at(0).observations.size(), 2u);
  EXPECT_EQ(Count(served.counters(), "repeated_requests"), 1);
}

TEST_F(PolicyServerTest, ImagesMayComeInAnyOrderTwiceAndBeforeTheirRequest) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  BareClient client(address);
  client.Start(0, 0, task_);
  for (const int index : {1, 1, 0}) client.Send("image", client.Image(0, 0, index, observation_.images[index]));
  client.Send("observation", client.Header(0, 0, observation_));
  EXPECT_EQ(client.NextChunk().error, "");
  const auto seen = probe.seen().at(0).observations.at(0);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(cv::norm(seen.images[i], observation_.images[i], cv::NORM_INF), 0);
}

TEST_F(PolicyServerTest, ARequestIsCompleteWithTheImagesItCountsAndWithNoOthers) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  BareClient client(address);
  client.Start(0, 0, task_);
  client.Send("observation", client.Header(0, 0, observation_));
  client.Send("image", client.Image(0, 0, 0, observation_.images[0]));
  client.Send("image", client.Image(0, 0, 5, observation_.images[1]));  // of no camera
  client.Send("image", client.Image(0, 0, 1, observation_.images[1]));
  EXPECT_EQ(client.NextChunk().error, "");
  EXPECT_EQ(probe.seen().at(0).observations.at(0).images.size(), 2u);

  image_t swapped = client.Image(0, 1, 0, observation_.images[0]);
  swapped.camera = "hand_right";
  client.Send("observation", client.Header(0, 1, observation_));
  client.Send("image", swapped);
  client.Send("image", client.Image(0, 1, 1, observation_.images[1]));
  EXPECT_EQ(client.NextChunk().error, "image 0 is of camera 'hand_right', wanted 'head'");
}

TEST_F(PolicyServerTest, ATaskOfMoreCamerasThanARequestCanHaveIsRefused) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  BareClient client(address);
  Task task = task_;
  task.cameras.resize(17, task_.cameras[0]);
  client.Start(0, 0, task);
  EXPECT_EQ(client.started.at(0).error, "the task has 17 cameras, wanted at most 16");
}

TEST_F(PolicyServerTest, ARepeatedStartIsOneReset) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  BareClient client(address);
  for (int i = 0; i < 3; ++i) client.Start(0, 0, task_);
  EXPECT_EQ(client.started.size(), 3u);
  EXPECT_EQ(Count(served.counters(), "resets"), 1);
}

TEST_F(PolicyServerTest, AnUnknownEpisodeIsAnsweredNotIgnored) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  BareClient client(address);
  client.Send("observation", client.Header(12, 0, observation_));
  const chunk_t reply = client.NextChunk();
  EXPECT_TRUE(reply.unknown_episode);
  EXPECT_EQ(reply.error, "this process was never told of episode 12");
}

TEST_F(PolicyServerTest, ClientsAndLanesHaveScenesOfTheirOwn) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  BareClient one(address, "one"), other(address, "other");
  one.Start(0, 0, task_);
  one.Start(1, 1, task_);
  other.Start(0, 0, task_);
  EXPECT_EQ(probe.seen().size(), 3u);
  one.Start(2, 1, task_);  // ends episode 1: its scene is free again
  EXPECT_EQ(probe.seen().size(), 3u);
  one.Send("observation", one.Header(1, 0, observation_));
  EXPECT_TRUE(one.NextChunk().unknown_episode);
}

TEST_F(PolicyServerTest, ImagesThatAreNotTheTasksAreAnErrorReply) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  BareClient client(address);
  client.Start(0, 0, task_);
  client.Send("observation", client.Header(0, 0, observation_));
  client.Send("image", client.Image(0, 0, 0, wire::Noise(8, 8, 1)));
  client.Send("image", client.Image(0, 0, 1, observation_.images[1]));
  EXPECT_THAT(client.NextChunk().error,
              testing::HasSubstr("the image of camera head is 8x8 with 3 channels, wanted 48x32 RGB"));
  image_t broken = client.Image(0, 1, 0, observation_.images[0]);
  broken.data.pop_back();
  broken.num_bytes -= 1;
  client.Send("observation", client.Header(0, 1, observation_));
  client.Send("image", broken);
  client.Send("image", client.Image(0, 1, 1, observation_.images[1]));
  EXPECT_THAT(client.NextChunk().error, testing::HasSubstr("4607 bytes, wanted 4608 for 48x32 RGB"));
}

TEST_F(PolicyServerTest, BytesThatAreNoMessageAreCountedAndHarmNoRequest) {
  const LcmAddress address = wire::OwnAddress();
  wire::ProbePolicy probe;
  wire::Served served(probe, wire::ProbeSpec(), address);
  BareClient client(address);
  client.Start(0, 0, task_);
  const std::vector<std::uint8_t> zeros(40);
  for (const char* message : {"hello", "start", "observation", "image", "bye"}) client.SendBytes(message, zeros);
  std::vector<std::uint8_t> cut = Encoded(client.Header(0, 0, observation_));
  cut.pop_back();
  client.SendBytes("observation", cut);
  client.Send("image", client.Image(0, 0, 16, observation_.images[1]));  // one more than a task may have
  client.Send("observation", client.Header(0, 0, observation_));
  for (int i = 0; i < 2; ++i) client.Send("image", client.Image(0, 0, i, observation_.images[i]));
  EXPECT_EQ(client.NextChunk().error, "");
  EXPECT_EQ(probe.seen().at(0).observations.size(), 1u);
  const Counters counters = served.counters();
  EXPECT_EQ(Count(counters, "undecodable_messages"), 7);
  EXPECT_EQ(Count(counters, "errors"), 0);
}

TEST_F(PolicyServerTest, WhatWaitsBehindAStopIsNotAnswered) {
  struct OnceOnly final : wire::ProbePolicy {
    void Reset(SceneId scene, const Task& task, std::uint64_t seed) override {
      ProbePolicy::Reset(scene, task, seed);
      server->Stop();
    }
    PolicyServer* server = nullptr;
  } policy;
  const LcmAddress address = wire::OwnAddress();
  PolicyServer server(policy, wire::ProbeSpec(), address);
  policy.server = &server;
  LcmLink link(address.url);
  int heard = 0;
  link.Subscribe(address.Channel("start"), [&](const std::string&, auto) { ++heard; });
  for (const int lane : {0, 1, 2}) link.Publish(address.Channel("start"), StartOf(task_, "bare", lane, lane));
  HearUntil(link, [&] { return heard == 3; });
  server.Run();
  EXPECT_EQ(Count(server.counters(), "resets"), 1);
}

TEST_F(PolicyServerTest, AServedPolicyLeavesOnSigtermWithExitCodeZero) {
  const LcmAddress address = wire::OwnAddress();
  const TempFolder folder;
  Child child({Binary("evac-policy"), "hold", "--chunk-size", "4", "--url", address.url, "--token", address.token},
              folder / "policy.log");
  {
    LcmPolicy policy({.address = address});
    policy.Handshake(HarnessSpec(task_, 4), 60);
    policy.Reset(0, task_, 1);
    const SceneObservation asked{0, &observation_};
    const auto answers = policy.Act({&asked, 1});
    ASSERT_EQ(Told(answers[0]), "chunk");
    const auto& targets = std::get<ActionChunk>(answers[0]).targets;
    EXPECT_EQ(targets.size(), 4u);
    EXPECT_TRUE(targets[3][0].base_from_gripper.isApprox(observation_.arms[0].base_from_gripper));
  }
  const int status = child.End(SIGTERM);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0) << ReadFile(folder / "policy.log");
}

}  // namespace
}  // namespace evac
