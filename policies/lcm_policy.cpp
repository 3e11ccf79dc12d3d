#include "policies/lcm_policy.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "core/error.h"
#include "policies/lcm_greeting.h"
#include "policies/lcm_lane.h"
#include "policies/messages.h"

namespace evac {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr double kLongestWait_s = 0.1;  ///< between two looks at the deadlines
constexpr double kLongestRepeat =
    8;  ///< of repeat_after_s: on a bad network a request needs many sendings, not few late ones

constexpr double kDay_s = 86400;  ///< the clock counts nanoseconds, for 292 years

Clock::time_point After(Clock::time_point from, double seconds) {
  return from + std::chrono::duration_cast<Clock::duration>(Seconds(seconds));
}

void CheckOptions(const LcmPolicyOptions& options) {
  if (!(options.deadline_s > 0 && options.deadline_s <= kDay_s))
    throw InvalidInput("policy deadline_s is {}, wanted more than 0, at most {}", options.deadline_s, kDay_s);
  if (!(options.start_s >= 0 && options.start_s <= kDay_s))
    throw InvalidInput("policy start_s is {}, wanted 0 … {}", options.start_s, kDay_s);
  if (!(options.repeat_after_s > 0 && options.repeat_after_s <= kDay_s))
    throw InvalidInput("policy repeat_after_s is {}, wanted more than 0, at most {}", options.repeat_after_s, kDay_s);
  if (options.jpeg_quality < 0 || options.jpeg_quality > 100) {
    throw InvalidInput("policy jpeg_quality is {}, wanted 0 … 100", options.jpeg_quality);
  }
}

}  // namespace

struct LcmPolicy::Impl {
  explicit Impl(LcmPolicyOptions given) : options(std::move(given)), link(options.address.url, options.pacing) {
    CheckOptions(options);
    Listen<declaration_t>("declaration", [this](const declaration_t& m) { TakeDeclaration(m); });
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
                     if (!decoded) {
                       ++noise;
                       return void(++counters["undecodable_replies"]);
                     }
                     if (decoded->client != client) return void(++counters["foreign_replies"]);
                     handler(*decoded);
                   });
  }

  // Asking.

  /// The start until it is acknowledged, then the request; each again when it stays unanswered.
  void Send(LcmLane& lane) {
    if (lane.sendings > 0) ++counters["repeats"];
    if (lane.has_started) {
      lane.header.attempt = lane.sendings;
      lane.header.deadline_s = Deadline_s() - Waited_s(lane);
      link.Publish(options.address.Channel("observation"), lane.header);
      for (const image_t& image : lane.images) link.Publish(options.address.Channel("image"), image);
    } else {
      link.Publish(options.address.Channel("start"), lane.start);
    }
    ++lane.sendings;
    lane.send_at = After(Clock::now(), lane.wait_s);
    lane.wait_s = std::min(2 * lane.wait_s, kLongestRepeat * options.repeat_after_s);
  }

  void AwaitAnswers(std::span<LcmLane* const> asked) {
    for (;;) {
      Clock::time_point next = After(Clock::now(), kLongestWait_s);
      bool is_complete = true;
      for (LcmLane* lane : asked) {
        if (!lane->answer && Clock::now() >= lane->send_at) Send(*lane);
        if (lane->answer) continue;
        is_complete = false;
        next = std::min(next, lane->send_at);
      }
      if (is_complete) return;
      awake_at = Clock::now();
      wait_s = std::max(0.0, Seconds(next - awake_at).count());
      link.Handle(wait_s);
      LeaveOutWhatWasSlept();
      GiveUpWhereHopeless(asked);
    }
  }

  /// Who was stopped (SIGSTOP) has not waited for anybody meanwhile: the policy may have been stopped with it. To be
  /// asked before each message is looked at, which may be what ended the sleep.
  void LeaveOutWhatWasSlept() {
    constexpr double kAwake_s = 1;  // for the message that was handled before
    const double asleep_s = Seconds(Clock::now() - awake_at).count() - wait_s;
    awake_at = Clock::now();
    wait_s = 0;
    if (asleep_s <= kAwake_s) return;
    slept_s += asleep_s;
    for (auto& [scene, lane] : lanes) lane.slept_s += asleep_s;
  }

  void GiveUpWhereHopeless(std::span<LcmLane* const> asked) {
    const std::optional<std::string> why_gone = WhyGone();
    const bool interrupted = options.interrupted && options.interrupted();
    const double deadline_s = Deadline_s();
    for (LcmLane* lane : asked) {
      if (lane->answer) continue;
      if (why_gone) lane->answer = Failure{StopReason::kPolicyError, "the policy is gone: " + *why_gone};
      if (interrupted) lane->answer = Failure{StopReason::kPolicyError, "interrupted"};
      const double waited_s = Waited_s(*lane);
      if (!lane->answer && waited_s > deadline_s) TimeOut(*lane, waited_s, deadline_s);
    }
  }

  /// Since the policy could have begun with this one: while it answers others, whoever comes last is not late. So how many
  /// lanes ask at a time changes no result.
  double Waited_s(const LcmLane& lane) const {
    return std::min(lane.Waited_s(), Seconds(Clock::now() - last_answer).count() - slept_s);
  }

  /// Of all who wait: while one's start is not acknowledged, the policy may be busy with it, and answers nobody.
  double Deadline_s() const {
    const auto is_starting = [](const auto& entry) { return !entry.second.has_started && !entry.second.answer; };
    return std::ranges::any_of(lanes, is_starting) ? std::max(options.start_s, options.deadline_s) : options.deadline_s;
  }

  void TimeOut(LcmLane& lane, double waited_s, double deadline_s) {
    ++counters["timeouts"];
    gave_up.insert(lane.header.episode);
    lane.gave_up = true;
    const std::string what =
        lane.has_started ? fmt::format("request {}", lane.header.request) : std::string("the episode's start");
    std::string heard = last_heard ? fmt::format("; the policy was last heard {:.1f} s ago",
                                                 Seconds(Clock::now() - *last_heard).count())
                                   : std::string("; the policy was never heard");
    if (lane.stale_replies > 0) heard += fmt::format("; it sent {} answers to earlier requests", lane.stale_replies);
    if (noise > 0) heard += fmt::format("; {} messages came that are none", noise);
    lane.answer = Failure{StopReason::kPolicyTimeout,
                          fmt::format("no answer to {} within {:.1f} s (sent {} times; deadline {} s){}", what,
                                      waited_s, lane.sendings, deadline_s, heard)};
    RestartIfSilentSince(std::max(lane.answerable_at, last_answer));
  }

  /// One that was started again since then owes no answer: of those that it leaves waiting, the first restarts it. What
  /// answered some of those who asked together, and no more after them, hangs as one that answered nobody does.
  void RestartIfSilentSince(Clock::time_point asked) {
    const auto is_later = [asked](const std::optional<Clock::time_point>& when) { return when && *when > asked; };
    if (!options.restart || is_later(last_heard) || is_later(restarted)) return;
    restarted = Clock::now();
    options.restart(asked);
  }

  std::optional<std::string> WhyGone() const { return options.why_gone ? options.why_gone() : std::nullopt; }

  // Hearing.

  LcmLane* Find(std::int64_t episode) {
    for (auto& [scene, lane] : lanes) {
      if (lane.header.episode == episode) return &lane;
    }
    return nullptr;
  }

  void TakeDeclaration(const declaration_t& declaration) {
    declarations.insert_or_assign(declaration.server, declaration);
    for (const episode_started_t& started : std::exchange(undeclared, {})) {
      if (started.server == declaration.server) TakeStarted(started);
    }
  }

  /// After the handshake, one that was started again must declare itself too before its episodes begin.
  void TakeStarted(const episode_started_t& started) {
    LeaveOutWhatWasSlept();
    last_heard = Clock::now();
    LcmLane* lane = Find(started.episode);
    if (lane == nullptr || lane->has_started) return;  // the answer to a repeated start
    if (policy && !declarations.contains(started.server)) {
      undeclared.push_back(started);
      return Greeting().SayHello(*harness);
    }
    lane->Started(started.server, options.repeat_after_s);
    Answered(lane->answerable_at);
    if (lane->answer) return;
    const std::string changes = policy ? Changes(*policy, FromWire(declarations.at(started.server).policy)) : "";
    if (!changes.empty())
      lane->answer = PolicyError("the policy was started again and declares otherwise: " + changes, "error_replies");
    else if (!started.error.empty())
      lane->answer = PolicyError("the policy refuses the task: " + started.error, "error_replies");
  }

  void TakeChunk(const chunk_t& reply) {
    LeaveOutWhatWasSlept();
    last_heard = Clock::now();
    if (IsReordered(reply)) ++counters["reordered_replies"];
    LcmLane* lane = Find(reply.episode);
    if (lane == nullptr) return void(++counters[gave_up.contains(reply.episode) ? "late_replies" : "stale_replies"]);
    if (reply.request > lane->header.request) return void(++counters["foreign_replies"]);
    if (reply.request < lane->header.request) {
      ++lane->stale_replies;
      return void(++counters["stale_replies"]);
    }
    if (lane->answer) return void(++counters[lane->gave_up ? "late_replies" : "duplicate_replies"]);
    if (!reply.unknown_episode && reply.server != lane->server) return void(++counters["foreign_replies"]);
    lane->answer = AnswerOf(reply, *lane);
    Answered(Clock::now());
    if (auto* chunk = std::get_if<ActionChunk>(&*lane->answer)) chunk->thinking_s = lane->Waited_s();
  }

  void Answered(Clock::time_point when) {
    last_answer = when;
    slept_s = 0;
  }

  bool IsReordered(const chunk_t& reply) {
    if (reply.unknown_episode) return false;  // sent outside the sequence
    const auto [last, is_new] = last_sequence.try_emplace(reply.server, reply.sequence);
    const bool is_reordered = !is_new && reply.sequence < last->second;
    last->second = std::max(last->second, reply.sequence);
    return is_reordered;
  }

  Acted AnswerOf(const chunk_t& reply, const LcmLane& lane) {
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
      if (chunk.targets.size() > wanted && !options.keep_longer_chunks) {
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

  LcmGreeting Greeting() {
    return {link,     options.address, client,           options.why_gone, options.interrupted,
            counters, options.who,     options.if_silent};
  }

  LcmPolicyOptions options;
  LcmLink link;
  std::string client = fmt::format("{}-{:08x}", getpid(), std::random_device()());
  std::map<std::string, declaration_t> declarations;  ///< by server
  std::vector<episode_started_t> undeclared;          ///< of servers that were asked for their declaration
  std::optional<PolicySpec> harness, policy;          ///< after the handshake
  std::map<SceneId, LcmLane> lanes;
  std::int64_t next_episode = 0;
  std::set<std::int64_t> gave_up;                     ///< episodes that ended by timeout
  std::map<std::string, std::int64_t> last_sequence;  ///< by server
  std::optional<Clock::time_point> last_heard, restarted;
  Clock::time_point last_answer;  ///< to a start or a request of this Act, or when it began
  double slept_s = 0;             ///< how long this process was stopped since then
  Clock::time_point awake_at;     ///< it was not stopped just then …
  double wait_s = 0;              ///< … and was to wait so long for the next message
  int noise = 0;  ///< undecodable replies since the last Act
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
  const PolicySpec policy = FromWire(impl_->Greeting().Await(harness, wait_s, impl_->declarations));
  if (!Compare(harness, policy).empty()) {
    throw InvalidInput("{} does not fit this run:\n{}", WhoDeclares(impl_->options.who, policy),
                       SideBySide(harness, policy));
  }
  impl_->harness = harness;
  impl_->policy = policy;
  return policy;
}

int LcmPolicy::declared() const { return static_cast<int>(impl_->declarations.size()); }

std::string LcmPolicy::Name() const { return impl_->policy ? impl_->policy->name : impl_->options.address.token; }

void LcmPolicy::Reset(SceneId scene, const Task& task, std::uint64_t seed) {
  const LcmEpisode episode{impl_->client, impl_->next_episode++, scene, seed};
  const PolicySpec any{.needs = {"images"}};
  impl_->lanes.insert_or_assign(scene, MakeLcmLane(episode, task, impl_->policy.value_or(any)));
}

std::vector<Acted> LcmPolicy::Act(std::span<const SceneObservation> batch) {
  const auto jpeg_quality = impl_->options.raw_images ? std::nullopt : std::optional(impl_->options.jpeg_quality);
  std::vector<LcmLane*> asked;
  impl_->noise = 0;
  impl_->Answered(Clock::now());
  for (const SceneObservation& scene : batch) {
    const auto lane = impl_->lanes.find(scene.scene);
    if (lane == impl_->lanes.end()) throw InternalError("scene {} was asked to act before its Reset", scene.scene);
    lane->second.Begin(*scene.observation, jpeg_quality, impl_->options.repeat_after_s);
    asked.push_back(&lane->second);
  }
  impl_->AwaitAnswers(asked);
  std::vector<Acted> answers;
  for (const LcmLane* lane : asked) answers.push_back(*lane->answer);
  return answers;
}

const Counters& LcmPolicy::counters() const { return impl_->counters; }

}  // namespace evac
