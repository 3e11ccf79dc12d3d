#include "policies/policy_server.h"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <deque>
#include <iterator>
#include <random>
#include <set>

#include "core/check.h"
#include "core/error.h"
#include "policies/messages.h"

namespace evac {
namespace {

constexpr std::size_t kRepliesKept = 4;   ///< per episode, for repeated requests
constexpr std::size_t kClientsKept = 32;  ///< a server that outlives many runs forgets the one longest silent
constexpr int kMaxImages = 16;

/// A request while its images come in.
struct Gathering {
  std::int64_t request = -1;
  std::optional<observation_t> header;
  std::map<int, image_t> images;  ///< by index

  /// Whether all that the request counts are there, whatever else came.
  bool IsComplete() const {
    return header && std::distance(images.begin(), images.lower_bound(header->num_images)) >= header->num_images;
  }
};

struct LiveEpisode {
  SceneId scene = 0;
  Task task;
  std::string refusal;  ///< why the policy refused the task, or empty
  Gathering gathering;
  std::deque<chunk_t> replies;  ///< newest last
};

struct Client {
  std::map<std::int64_t, LiveEpisode> episodes;
  std::map<int, std::int64_t> episode_in_lane;
  std::int64_t replies_sent = 0;
  std::int64_t last_heard = 0;  ///< the server's message count then
};

/// @throws InvalidInput if this is not what the task's cameras and arms would see.
Observation ObservationOf(const Gathering& gathered, const Task& task) {
  Observation observation;
  for (auto image = gathered.images.begin(); image != gathered.images.lower_bound(gathered.header->num_images); ++image)
    observation.images.push_back(ImageOf(image->second));
  for (const arm_state_t& arm : gathered.header->arms)
    observation.arms.push_back(FromWire(arm, "the observation's arms"));
  observation.arms_are_commanded = gathered.header->arms_are_commanded != 0;
  if (const auto wrong = WhatIsWrong(observation, task)) throw InvalidInput("{}", *wrong);
  for (std::size_t i = 0; i < task.cameras.size(); ++i) {
    const std::string& found = gathered.images.at(static_cast<int>(i)).camera;
    if (found != task.cameras[i].name)
      throw InvalidInput("image {} is of camera '{}', wanted '{}'", i, found, task.cameras[i].name);
  }
  return observation;
}

void PutChunk(const ActionChunk& chunk, chunk_t& reply) {
  reply.ends_recording = chunk.ends_recording;
  for (const Arms& target : chunk.targets) reply.targets.push_back(ToWire(target));
  reply.num_targets = static_cast<int>(chunk.targets.size());
  reply.num_arms = chunk.targets.empty() ? 0 : static_cast<int>(chunk.targets.front().size());
  for (const auto& target : reply.targets) {
    if (static_cast<int>(target.size()) != reply.num_arms)
      throw InvalidInput("its targets have different numbers of arms");
  }
}

}  // namespace

struct PolicyServer::Impl {
  Impl(Policy& wrapped, PolicySpec its_spec, const LcmAddress& at)
      : policy(wrapped), spec(std::move(its_spec)), address(at), link(at.url) {
    Listen<hello_t>("hello", [this](const hello_t& hello) { Declare(hello); });
    Listen<episode_start_t>("start", [this](const episode_start_t& start) { Start(start); });
    Listen<observation_t>("observation", [this](const observation_t& header) { TakeHeader(header); });
    Listen<image_t>("image", [this](const image_t& image) { TakeImage(image); });
    Listen<bye_t>("bye", [this](const bye_t& bye) { Forget(bye.client); });
    link.Subscribe(LcmAddress::AnyChannel("(hello|start|observation)"), [this](const std::string& channel, auto) {
      if (!mine.contains(channel)) ++counters["foreign_messages"];
    });
  }

  template <typename Message, typename Handler>
  void Listen(const std::string& message, Handler handler) {
    mine.insert(address.Channel(message));
    link.Subscribe(address.Channel(message), [this, handler](const std::string&, std::span<const std::uint8_t> bytes) {
      if (const auto decoded = Decoded<Message>(bytes)) {
        handler(*decoded);
      } else {
        ++counters["undecodable_messages"];
      }
    });
  }

  Client& Heard(const std::string& name) {
    Client& client = clients[name];
    client.last_heard = ++messages_heard;
    if (clients.size() > kClientsKept) {
      const auto older = [](const auto& a, const auto& b) { return a.second.last_heard < b.second.last_heard; };
      Forget(std::min_element(clients.begin(), clients.end(), older)->first);
    }
    return client;
  }

  LiveEpisode* Find(const std::string& client, std::int64_t episode) {
    const auto known = clients.find(client);
    if (known == clients.end()) return nullptr;
    known->second.last_heard = ++messages_heard;
    const auto found = known->second.episodes.find(episode);
    return found == known->second.episodes.end() ? nullptr : &found->second;
  }

  void Forget(std::string name) {  // a copy: the original may be the key of what is erased
    const auto client = clients.find(name);
    if (client == clients.end()) return;
    for (const auto& [number, episode] : client->second.episodes) scenes_in_use.erase(episode.scene);
    clients.erase(client);
  }

  void Declare(const hello_t& hello) {
    declaration_t declaration;
    declaration.policy = ToWire(spec);
    declaration.client = hello.client;
    declaration.server = name;
    link.Publish(address.Channel("declaration"), declaration);
  }

  void Start(const episode_start_t& start) {
    Client& client = Heard(start.client);
    if (!client.episodes.contains(start.episode)) Begin(start, client);
    episode_started_t started;
    started.client = start.client;
    started.server = name;
    started.episode = start.episode;
    started.error =
        client.episodes.contains(start.episode) ? client.episodes[start.episode].refusal : "the episode is over";
    link.Publish(address.Channel("started"), started);
  }

  void Begin(const episode_start_t& start, Client& client) {
    const auto before = client.episode_in_lane.find(start.lane);
    if (before != client.episode_in_lane.end()) {
      if (before->second > start.episode) return;  // a repeat that was overtaken by the lane's next episode
      scenes_in_use.erase(client.episodes[before->second].scene);
      client.episodes.erase(before->second);
    }
    client.episode_in_lane[start.lane] = start.episode;
    LiveEpisode& episode = client.episodes[start.episode];
    while (scenes_in_use.contains(episode.scene)) ++episode.scene;
    scenes_in_use.insert(episode.scene);
    ++counters["resets"];
    try {
      episode.task = TaskOf(start);
      if (episode.task.cameras.size() > kMaxImages)
        throw InvalidInput("the task has {} cameras, wanted at most {}", episode.task.cameras.size(), kMaxImages);
      policy.Reset(episode.scene, episode.task, static_cast<std::uint64_t>(start.seed));
    } catch (const std::exception& error) {
      episode.refusal = error.what();
    }
  }

  void TakeHeader(const observation_t& header) {
    LiveEpisode* episode = Find(header.client, header.episode);
    if (episode == nullptr) return RefuseUnknown(header);
    if (!IsWanted(*episode, header.client, header.request)) return;
    episode->gathering.header = header;
    AnswerIfComplete(*episode);
  }

  void TakeImage(const image_t& image) {
    LiveEpisode* episode = Find(image.client, image.episode);
    if (episode == nullptr) return;  // the header says so to the client
    if (image.index < 0 || image.index >= kMaxImages) return void(++counters["undecodable_messages"]);
    const bool is_answered = !episode->replies.empty() && image.request <= episode->replies.back().request;
    if (is_answered || image.request < episode->gathering.request) return;  // the header decides what to do about it
    if (image.request > episode->gathering.request)
      episode->gathering = {.request = image.request, .header = {}, .images = {}};
    episode->gathering.images.insert_or_assign(image.index, image);
    AnswerIfComplete(*episode);
  }

  /// Answers a repeated request from the cache; whether this one is new, and room is made for it.
  bool IsWanted(LiveEpisode& episode, const std::string& client, std::int64_t request) {
    const auto kept = std::find_if(episode.replies.begin(), episode.replies.end(),
                                   [&](const chunk_t& r) { return r.request == request; });
    if (kept != episode.replies.end()) {
      ++counters["repeated_requests"];
      Send(*kept, clients[client]);
      return false;
    }
    const bool is_older = !episode.replies.empty() && request < episode.replies.back().request;
    if (is_older || request < episode.gathering.request) {
      ++counters["stale_requests"];
      return false;
    }
    if (request > episode.gathering.request) episode.gathering = {.request = request, .header = {}, .images = {}};
    return true;
  }

  void AnswerIfComplete(LiveEpisode& episode) {
    if (!episode.gathering.IsComplete()) return;
    ++counters["requests"];
    episode.replies.push_back(Answer(episode));
    if (episode.replies.size() > kRepliesKept) episode.replies.pop_front();
    episode.gathering = {.request = episode.gathering.request, .header = {}, .images = {}};
    Send(episode.replies.back(), clients[episode.replies.back().client]);
  }

  chunk_t Answer(const LiveEpisode& episode) {
    chunk_t reply = EmptyReply(*episode.gathering.header);
    try {
      if (!episode.refusal.empty()) throw InvalidInput("{}", episode.refusal);
      const Observation observation = ObservationOf(episode.gathering, episode.task);
      const SceneObservation asked{episode.scene, &observation};
      const std::vector<Acted> acted = policy.Act({&asked, 1});
      if (acted.size() != 1)
        throw InternalError("{} answered {} times to one observation", policy.Name(), acted.size());
      if (const auto* failure = std::get_if<Failure>(&acted.front())) throw InternalError("{}", failure->message);
      PutChunk(std::get<ActionChunk>(acted.front()), reply);
    } catch (const std::exception& error) {
      ++counters["errors"];
      reply = EmptyReply(*episode.gathering.header);
      reply.error = error.what();
    }
    return reply;
  }

  chunk_t EmptyReply(const observation_t& header) const {
    chunk_t reply{};
    reply.client = header.client;
    reply.server = name;
    reply.episode = header.episode;
    reply.request = header.request;
    return reply;
  }

  void RefuseUnknown(const observation_t& header) {
    ++counters["errors"];
    chunk_t reply = EmptyReply(header);
    reply.error = fmt::format("this process was never told of episode {}", header.episode);
    reply.unknown_episode = 1;
    link.Publish(address.Channel("chunk"), reply);
  }

  void Send(chunk_t& reply, Client& client) {
    reply.sequence = client.replies_sent++;
    link.Publish(address.Channel("chunk"), reply);
  }

  Policy& policy;
  PolicySpec spec;
  LcmAddress address;
  LcmLink link;
  std::string name = fmt::format("{}-{:08x}", getpid(), std::random_device()());
  std::set<std::string> mine;  ///< the channels listened to
  std::map<std::string, Client> clients;
  std::set<SceneId> scenes_in_use;
  std::int64_t messages_heard = 0;
  Counters counters;
};

PolicyServer::PolicyServer(Policy& policy, PolicySpec spec, const LcmAddress& address)
    : impl_(std::make_unique<Impl>(policy, std::move(spec), address)) {}

PolicyServer::~PolicyServer() = default;

void PolicyServer::Handle(double timeout_s) { impl_->link.HandleOne(timeout_s); }

void PolicyServer::Run() {
  while (!stop_) Handle(0.1);
}

const Counters& PolicyServer::counters() const { return impl_->counters; }

namespace {

/// Set by a signal handler, which may run in any thread.
std::atomic<bool> g_must_end = false;
static_assert(std::atomic<bool>::is_always_lock_free);

/// SIGTERM and SIGINT end the loop. They are blocked here and in LCM's thread, which inherits that (a select that they
/// interrupt is an error to LCM), and wait for sigtimedwait; threads that libraries started before may still take them,
/// which is what the handler is for.
sigset_t CatchEnding() {
  sigset_t ending;
  sigemptyset(&ending);
  for (const int number : {SIGTERM, SIGINT}) {
    sigaddset(&ending, number);
    std::signal(number, [](int) { g_must_end = true; });
  }
  pthread_sigmask(SIG_BLOCK, &ending, nullptr);
  return ending;
}

}  // namespace

int ServePolicy(Policy& policy, const PolicySpec& spec, const LcmAddress& address) {
  const sigset_t ending = CatchEnding();
  const pid_t parent = getppid();
  PolicyServer server(policy, spec, address);
  const timespec at_once{};
  const bool is_supervised = std::getenv("EVAC_SUPERVISED") != nullptr;
  const auto must_end = [&] { return g_must_end || sigtimedwait(&ending, nullptr, &at_once) > 0; };
  while (!must_end() && !(is_supervised && getppid() != parent)) server.Handle(0.1);
  return 0;
}

}  // namespace evac
