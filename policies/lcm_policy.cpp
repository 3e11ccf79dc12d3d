#include "policies/lcm_policy.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <set>

#include "core/error.h"
#include "policies/messages.h"

namespace evac {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr double kLongestWait_s = 0.1;  ///< between two looks at the deadlines

Clock::time_point After(Clock::time_point from, double seconds) {
  return from + std::chrono::duration_cast<Clock::duration>(Seconds(seconds));
}

/// One scene's episode, and the one request that is under way in it.
struct Lane {
  Task task;                      ///< as the policy sees it: with the cameras it declared
  std::vector<std::size_t> sent;  ///< which of the observation's images those are
  episode_start_t start;
  bool has_started = false;
  std::string server;  ///< who acknowledged the start
  observation_t header;
  std::vector<image_t> images;
  std::optional<Acted> answer = ActionChunk{};  ///< of the request under way; set: nobody waits
  bool gave_up = false;                         ///< the answer is policy_timeout
  int sendings = 0;
  double wait_s = 0;
  Clock::time_point asked_at, send_at;
};

/// The cameras of the task whose images the policy wants, as indices.
std::vector<std::size_t> WantedCameras(const Task& task, const PolicySpec& policy) {
  std::vector<std::size_t> wanted;
  for (std::size_t i = 0; policy.needs.contains("images") && i < task.cameras.size(); ++i) {
    const auto is_it = [&](const CameraNeed& need) { return need.name == task.cameras[i].name; };
    if (policy.cameras.empty() || std::any_of(policy.cameras.begin(), policy.cameras.end(), is_it)) wanted.push_back(i);
  }
  return wanted;
}

void CheckOptions(const LcmPolicyOptions& options) {
  if (!(options.deadline_s > 0))
    throw InvalidInput("policy deadline_s is {}, wanted a positive number", options.deadline_s);
  if (!(options.repeat_after_s > 0))
    throw InvalidInput("policy repeat_after_s is {}, wanted a positive number", options.repeat_after_s);
  if (options.jpeg_quality < 0 || options.jpeg_quality > 100) {
    throw InvalidInput("policy jpeg_quality is {}, wanted 0 … 100", options.jpeg_quality);
  }
}

}  // namespace

struct LcmPolicy::Impl {
  explicit Impl(LcmPolicyOptions given) : options(std::move(given)), link(options.address.url, options.pacing) {
    CheckOptions(options);
    Listen<declaration_t>("declaration",
                          [this](const declaration_t& m) { declarations.insert_or_assign(m.server, m); });
    Listen<episode_started_t>("started", [this](const episode_started_t& m) { TakeStarted(m); });
    Listen<chunk_t>("chunk", [this](const chunk_t& m) { TakeChunk(m); });
  }

  /// Hears every token's replies of that kind, so that strangers are counted; hands on those that are for this client.
  template <typename Message, typename Handler>
  void Listen(const std::string& message, Handler handler) {
    const std::string mine = options.address.Channel(message);
    link.Subscribe(LcmAddress::AnyChannel(message),
                   [=, this](const std::string& channel, std::span<const std::uint8_t> bytes) {
                     if (channel != mine) return void(++counters["foreign_replies"]);
                     const auto decoded = Decoded<Message>(bytes);
                     if (!decoded) return void(++counters["undecodable_replies"]);
                     if (decoded->client != client) return void(++counters["foreign_replies"]);
                     handler(*decoded);
                   });
  }

  // The handshake.

  void SayHello(const PolicySpec& harness) {
    hello_t hello;
    hello.harness = ToWire(harness);
    hello.client = client;
    link.Publish(options.address.Channel("hello"), hello);
  }

  void AwaitDeclaration(const PolicySpec& harness, double wait_s) {
    const Clock::time_point end = After(Clock::now(), wait_s);
    while (declarations.empty()) {
      if (Clock::now() > end) ThrowNobodyAnswers(wait_s);
      if (const auto why = WhyGone()) throw InvalidInput("the policy is gone before it declared itself: {}", *why);
      SayHello(harness);
      link.Handle(kLongestWait_s);
    }
    RefuseTwoPolicies(harness);
  }

  /// One who died while greeting may have answered too; who answers a second greeting is alive.
  void RefuseTwoPolicies(const PolicySpec& harness) {
    const declaration_t first = declarations.begin()->second;
    declarations.clear();
    SayHello(harness);
    for (const auto end = After(Clock::now(), kLongestWait_s); Clock::now() < end;) link.Handle(kLongestWait_s / 10);
    if (declarations.empty()) declarations[first.server] = first;
    if (declarations.size() == 1) return;
    throw InvalidInput(
        "{} policies answer on {} with token {} ({}, {} …): stop all but one, or give each a token of its own",
        declarations.size(), options.address.url, options.address.token, declarations.begin()->second.policy.name,
        std::next(declarations.begin())->second.policy.name);
  }

  [[noreturn]] void ThrowNobodyAnswers(double wait_s) {
    const std::int64_t undecodable = counters["undecodable_replies"];
    const std::string hint =
        undecodable > 0 ? fmt::format("; {} answers came in another version of the message types", undecodable) : "";
    throw InvalidInput(
        "no policy answered within {} s on {} with token {}{}. One that runs elsewhere joins with these as "
        "EVAC_LCM_URL and EVAC_TOKEN, or as --url and --token",
        wait_s, options.address.url, options.address.token, hint);
  }

  // Asking.

  void Begin(Lane& lane, const Observation& observation) {
    lane.answer.reset();
    lane.gave_up = false;
    lane.header.request += 1;
    lane.header.arms = ToWire(observation.arms);
    lane.header.num_arms = static_cast<int>(lane.header.arms.size());
    lane.header.arms_are_commanded = observation.arms_are_commanded;
    lane.images.clear();
    for (std::size_t i = 0; i < lane.sent.size(); ++i) {
      if (lane.sent[i] >= observation.images.size())
        throw InternalError("the observation lacks the image of camera {}", lane.task.cameras[i].name);
      lane.images.push_back(ImageMessage(lane, static_cast<int>(i), observation.images[lane.sent[i]]));
    }
    lane.asked_at = lane.send_at = Clock::now();
    lane.wait_s = options.repeat_after_s;
    lane.sendings = 0;
  }

  image_t ImageMessage(const Lane& lane, int index, const cv::Mat& rgb) const {
    image_t message;
    message.client = client;
    message.episode = lane.header.episode;
    message.request = lane.header.request;
    message.index = index;
    message.camera = lane.task.cameras[index].name;
    PutImage(rgb, options.raw_images ? std::nullopt : std::optional(options.jpeg_quality), message);
    return message;
  }

  /// The start until it is acknowledged, then the request; each again when it stays unanswered.
  void Send(Lane& lane) {
    if (lane.sendings > 0) ++counters["repeats"];
    if (lane.has_started) {
      lane.header.attempt = lane.sendings;
      lane.header.deadline_s = options.deadline_s - Seconds(Clock::now() - lane.asked_at).count();
      link.Publish(options.address.Channel("observation"), lane.header);
      for (const image_t& image : lane.images) link.Publish(options.address.Channel("image"), image);
    } else {
      link.Publish(options.address.Channel("start"), lane.start);
    }
    ++lane.sendings;
    lane.send_at = After(Clock::now(), lane.wait_s);
    lane.wait_s *= 2;
  }

  void AwaitAnswers(std::span<Lane* const> asked) {
    for (;;) {
      Clock::time_point next = After(Clock::now(), kLongestWait_s);
      bool is_complete = true;
      for (Lane* lane : asked) {
        if (!lane->answer && Clock::now() >= lane->send_at) Send(*lane);
        if (lane->answer) continue;
        is_complete = false;
        next = std::min(next, lane->send_at);
      }
      if (is_complete) return;
      link.Handle(std::max(0.0, Seconds(next - Clock::now()).count()));
      GiveUpWhereHopeless(asked);
    }
  }

  void GiveUpWhereHopeless(std::span<Lane* const> asked) {
    const std::optional<std::string> why_gone = WhyGone();
    for (Lane* lane : asked) {
      const double waited_s = Seconds(Clock::now() - lane->asked_at).count();
      if (lane->answer) continue;
      if (why_gone) lane->answer = Failure{StopReason::kPolicyError, "the policy is gone: " + *why_gone};
      if (!lane->answer && waited_s > options.deadline_s) TimeOut(*lane, waited_s);
    }
  }

  void TimeOut(Lane& lane, double waited_s) {
    ++counters["timeouts"];
    gave_up.insert(lane.header.episode);
    lane.gave_up = true;
    const std::string what =
        lane.has_started ? fmt::format("request {}", lane.header.request) : std::string("the episode's start");
    const std::string silence = last_heard ? fmt::format("; the policy was last heard {:.1f} s ago",
                                                         Seconds(Clock::now() - *last_heard).count())
                                           : std::string("; the policy was never heard");
    lane.answer = Failure{StopReason::kPolicyTimeout,
                          fmt::format("no answer to {} within {:.1f} s (sent {} times; deadline {} s){}", what,
                                      waited_s, lane.sendings, options.deadline_s, silence)};
  }

  std::optional<std::string> WhyGone() const { return options.why_gone ? options.why_gone() : std::nullopt; }

  // Hearing.

  Lane* Find(std::int64_t episode) {
    for (auto& [scene, lane] : lanes) {
      if (lane.header.episode == episode) return &lane;
    }
    return nullptr;
  }

  void TakeStarted(const episode_started_t& started) {
    last_heard = Clock::now();
    Lane* lane = Find(started.episode);
    if (lane == nullptr || lane->has_started) return;  // the answer to a repeated start
    lane->has_started = true;
    lane->server = started.server;
    lane->sendings = 0;
    lane->wait_s = options.repeat_after_s;
    lane->send_at = Clock::now();
    if (!started.error.empty() && !lane->answer)
      lane->answer = PolicyError("the policy refuses the task: " + started.error, "error_replies");
  }

  void TakeChunk(const chunk_t& reply) {
    last_heard = Clock::now();
    if (IsReordered(reply)) ++counters["reordered_replies"];
    Lane* lane = Find(reply.episode);
    if (lane == nullptr) return void(++counters[gave_up.contains(reply.episode) ? "late_replies" : "stale_replies"]);
    if (reply.request > lane->header.request) return void(++counters["foreign_replies"]);
    if (reply.request < lane->header.request) return void(++counters["stale_replies"]);
    if (lane->answer) return void(++counters[lane->gave_up ? "late_replies" : "duplicate_replies"]);
    if (!reply.unknown_episode && reply.server != lane->server) return void(++counters["foreign_replies"]);
    lane->answer = AnswerOf(reply, *lane);
  }

  bool IsReordered(const chunk_t& reply) {
    if (reply.unknown_episode) return false;  // sent outside the sequence
    const auto [last, is_new] = last_sequence.try_emplace(reply.server, reply.sequence);
    const bool is_reordered = !is_new && reply.sequence < last->second;
    last->second = std::max(last->second, reply.sequence);
    return is_reordered;
  }

  Acted AnswerOf(const chunk_t& reply, const Lane& lane) {
    if (reply.unknown_episode)
      return PolicyError("the policy was restarted in the middle of the episode: " + reply.error, "error_replies");
    if (!reply.error.empty()) return PolicyError("the policy answered with an error: " + reply.error, "error_replies");
    try {
      ActionChunk chunk = FromWire(reply, lane.task.arms);
      const std::size_t wanted = harness ? harness->chunk_size : chunk.targets.size();
      if (chunk.targets.size() < wanted && !chunk.ends_recording) {
        throw InvalidInput("the chunk has {} targets, wanted {} (only the end of a recording may be shorter)",
                           chunk.targets.size(), wanted);
      }
      if (chunk.targets.size() > wanted) {
        chunk.targets.resize(wanted);
        chunk.ends_recording = false;
      }
      return chunk;
    } catch (const Error& error) {
      return PolicyError(fmt::format("malformed answer to request {}: {}", reply.request, error.what()),
                         "malformed_replies");
    }
  }

  Failure PolicyError(const std::string& message, const char* counter) {
    ++counters[counter];
    return {StopReason::kPolicyError, message};
  }

  LcmPolicyOptions options;
  LcmLink link;
  std::string client = fmt::format("{}-{:08x}", getpid(), std::random_device()());
  std::map<std::string, declaration_t> declarations;  ///< by server
  std::optional<PolicySpec> harness, policy;          ///< after the handshake
  std::map<SceneId, Lane> lanes;
  std::int64_t next_episode = 0;
  std::set<std::int64_t> gave_up;                     ///< episodes that ended by timeout
  std::map<std::string, std::int64_t> last_sequence;  ///< by server
  std::optional<Clock::time_point> last_heard;
  Counters counters;
};

LcmPolicy::LcmPolicy(LcmPolicyOptions options) : impl_(std::make_unique<Impl>(std::move(options))) {}

LcmPolicy::~LcmPolicy() {
  try {
    bye_t bye;
    bye.client = impl_->client;
    impl_->link.Publish(impl_->options.address.Channel("bye"), bye);
  } catch (const std::exception&) {  // nobody needs to hear it
  }
}

PolicySpec LcmPolicy::Handshake(const PolicySpec& harness, double wait_s) {
  impl_->declarations.clear();
  impl_->AwaitDeclaration(harness, wait_s);
  const PolicySpec policy = FromWire(impl_->declarations.begin()->second.policy);
  if (!Compare(harness, policy).empty()) {
    throw InvalidInput("policy {}@{} does not fit this run:\n{}", policy.name, policy.checkpoint,
                       SideBySide(harness, policy));
  }
  impl_->harness = harness;
  impl_->policy = policy;
  return policy;
}

std::string LcmPolicy::Name() const { return impl_->policy ? impl_->policy->name : impl_->options.address.token; }

void LcmPolicy::Reset(SceneId scene, const Task& task, std::uint64_t seed) {
  Lane lane;
  lane.task = task;
  lane.sent = impl_->policy ? WantedCameras(task, *impl_->policy) : WantedCameras(task, {.needs = {"images"}});
  lane.task.cameras.clear();
  for (const std::size_t i : lane.sent) lane.task.cameras.push_back(task.cameras[i]);
  PutTask(lane.task, lane.start);
  lane.start.client = impl_->client;
  lane.start.episode = impl_->next_episode++;
  lane.start.lane = scene;
  lane.start.seed = static_cast<std::int64_t>(seed);
  lane.header.client = impl_->client;
  lane.header.episode = lane.start.episode;
  lane.header.request = -1;
  lane.header.task_id = task.id;
  lane.header.instruction = task.instruction;
  lane.header.cameras = lane.start.cameras;
  lane.header.num_images = static_cast<int>(lane.start.cameras.size());
  impl_->lanes.insert_or_assign(scene, std::move(lane));
}

std::vector<Acted> LcmPolicy::Act(std::span<const SceneObservation> batch) {
  std::vector<Lane*> asked;
  for (const SceneObservation& scene : batch) {
    const auto lane = impl_->lanes.find(scene.scene);
    if (lane == impl_->lanes.end()) throw InternalError("scene {} was asked to act before its Reset", scene.scene);
    impl_->Begin(lane->second, *scene.observation);
    asked.push_back(&lane->second);
  }
  impl_->AwaitAnswers(asked);
  std::vector<Acted> answers;
  for (const Lane* lane : asked) answers.push_back(*lane->answer);
  return answers;
}

const Counters& LcmPolicy::counters() const { return impl_->counters; }

}  // namespace evac
