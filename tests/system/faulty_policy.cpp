/// A policy that does wrong what it is told to do wrong, at one episode or at all; for tests of the harness. It speaks
/// the wire itself, so that it can say what no honest server would.
///
///   faulty-policy [--fault NAME[@SEED]]… [--while FILE] [--late-s S] [--declare FIELD=VALUE]…
///
/// A fault with a seed is the one of the episode with that seed; without, of all episodes. Without a fault it wanders a
/// little for four chunks, a function of seed and request, and then rests.
#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>

#include "core/seed.h"
#include "policies/lcm_link.h"
#include "policies/messages.h"

namespace evac {
namespace {

constexpr int kChunk = 8;
constexpr int kMovingRequests = 4;
constexpr std::int64_t kFaultyRequest = 2;

struct Options {
  std::string everywhere;                        ///< the fault of all episodes that have none of their own
  std::map<std::uint64_t, std::string> by_seed;  ///< the fault of an episode
  std::filesystem::path only_while;              ///< … and only while this file is there
  double late_s = 5;
  PolicySpec spec{.name = "faulty", .checkpoint = "v1", .chunk_size = kChunk, .needs = {"arms"}};
};

void Declare(const std::string& assignment, PolicySpec& spec) {
  const std::string field = assignment.substr(0, assignment.find('=')), value = assignment.substr(field.size() + 1);
  if (field == "action_space") spec.action_space = value;
  if (field == "quaternion_order") spec.quaternion_order = value;
  if (field == "image_format") spec.image_format = value;
  if (field == "gripper_open") spec.gripper_open = std::stod(value);
  if (field == "gripper_closed") spec.gripper_closed = std::stod(value);
  if (field == "period_s") spec.period_s = std::stod(value);
  if (field == "arms") spec.arms = {value};
  if (field == "needs") spec.needs.insert(value);
}

Options Parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i + 1 < argc; i += 2) {
    const std::string name = argv[i], value = argv[i + 1];
    const std::size_t at = value.find('@');
    if (name == "--fault" && at == std::string::npos) options.everywhere = value;
    if (name == "--fault" && at != std::string::npos)
      options.by_seed[std::stoull(value.substr(at + 1))] = value.substr(0, at);
    if (name == "--while") options.only_while = value;
    if (name == "--late-s") options.late_s = std::stod(value);
    if (name == "--declare") Declare(value, options.spec);
  }
  return options;
}

class FaultyPolicy {
 public:
  FaultyPolicy(Options options, const LcmAddress& address)
      : options_(std::move(options)), address_(address), link_(address.url) {
    Listen<hello_t>("hello", [this](const hello_t& hello) {
      declaration_t declaration;
      declaration.policy = ToWire(options_.spec);
      declaration.client = hello.client;
      declaration.server = name_;
      link_.Publish(address_.Channel("declaration"), declaration);
    });
    Listen<episode_start_t>("start", [this](const episode_start_t& start) {
      seeds_[start.episode] = static_cast<std::uint64_t>(start.seed);
      episode_started_t started;
      started.client = start.client;
      started.server = name_;
      started.episode = start.episode;
      link_.Publish(address_.Channel("started"), started);
    });
    Listen<observation_t>("observation", [this](const observation_t& asked) { Answer(asked); });
  }

  void Run() {
    for (;;) link_.Handle(1);
  }

 private:
  template <typename Message, typename Handler>
  void Listen(const std::string& message, Handler handler) {
    link_.Subscribe(address_.Channel(message), [handler](const std::string&, std::span<const std::uint8_t> bytes) {
      if (const auto decoded = Decoded<Message>(bytes)) handler(*decoded);
    });
  }

  /// What goes wrong with this request: empty if nothing does.
  std::string FaultOf(const observation_t& asked) const {
    const auto own = options_.by_seed.find(seeds_.at(asked.episode));
    const std::string fault = own == options_.by_seed.end() ? options_.everywhere : own->second;
    const bool is_time = options_.only_while.empty() || std::filesystem::exists(options_.only_while);
    return is_time && (asked.request == kFaultyRequest || IsOfConvention(fault)) ? fault : "";
  }
  /// Wrong from the first answer on.
  static bool IsOfConvention(const std::string& f) {
    return f == "wxyz" || f == "delta" || f == "degrees" || f == "millimetres" || f == "other_period" ||
           f == "reversed" || f == "silent";
  }

  void Answer(const observation_t& asked) {
    chunk_t reply{};
    reply.client = asked.client;
    reply.server = name_;
    reply.episode = asked.episode;
    reply.request = asked.request;
    reply.sequence = sent_++;
    reply.unknown_episode = !seeds_.contains(asked.episode);
    if (reply.unknown_episode) {
      reply.error = "this process was never told of the episode";
    } else {
      Wander(asked, reply);
      if (!Spoil(FaultOf(asked), asked, reply)) return;
    }
    link_.Publish(address_.Channel("chunk"), reply);
  }

  void Wander(const observation_t& asked, chunk_t& reply) {
    SplitMix64 random(SeedFor(seeds_.at(asked.episode), static_cast<std::uint64_t>(asked.request)));
    const double reach_m = asked.request < kMovingRequests ? 0.02 : 0;
    const double to_m[] = {reach_m * random.Uniform(-1, 1), reach_m * random.Uniform(-1, 1),
                           reach_m * random.Uniform()};
    reply.num_targets = kChunk;
    reply.num_arms = asked.num_arms;
    for (int k = 1; k <= kChunk; ++k) {
      std::vector<arm_state_t> target = asked.arms;
      for (int axis = 0; axis < 3; ++axis) target[0].position_m[axis] += to_m[axis] * k / kChunk;
      reply.targets.push_back(target);
    }
  }

  /// @returns whether the reply is to be sent after all.
  bool Spoil(const std::string& fault, const observation_t& asked, chunk_t& reply) {
    if (fault == "die") ::kill(::getpid(), SIGKILL);
    if (fault == "hang") {
      fmt::print("hangs\n");
      std::fflush(stdout);
      for (;;) ::pause();
    }
    if (fault == "late") {
      fmt::print("is late\n");
      std::fflush(stdout);
      ::usleep(static_cast<useconds_t>(options_.late_s * 1e6));
    }
    if (fault == "silent") return fmt::print("is silent\n"), std::fflush(stdout), false;
    if (fault == "previous") --reply.request;
    if (fault == "error") reply.error = "CUDA out of memory";
    if (fault == "short") reply.targets.resize(reply.num_targets = 5);
    if (fault == "noise") return Shout(), false;
    for (std::size_t k = 0; k < reply.targets.size(); ++k) SpoilTarget(fault, asked.arms[0], k, reply.targets[k][0]);
    return true;
  }

  static void SpoilTarget(const std::string& fault, const arm_state_t& at, std::size_t k, arm_state_t& target) {
    double* p = target.position_m;
    double* q = target.orientation_xyzw;
    if (fault == "nan") p[1] = std::nan("");
    if (fault == "quaternion") q[3] += 0.5;
    if (fault == "outside") p[2] = 1.9;
    if (fault == "wxyz") {
      const double w = q[3];
      q[3] = q[2], q[2] = q[1], q[1] = q[0], q[0] = w;
    }
    if (fault == "delta") {
      for (int i = 0; i < 3; ++i) p[i] -= at.position_m[i], q[i] = 0;
      q[3] = 1;
    }
    if (fault == "millimetres") {
      for (int i = 0; i < 3; ++i) p[i] *= 1000;
    }
    if (fault == "degrees") target.closure = 57.3;
    if (fault == "reversed") target.closure = 1 - target.closure;
    if (fault == "other_period") p[0] = at.position_m[0] + 0.35 * static_cast<double>(k);
  }

  /// Ten megabytes of noise where its answer belongs.
  void Shout() {
    SplitMix64 random(10);
    std::vector<std::uint8_t> noise(10'000'000);
    for (std::uint8_t& byte : noise) byte = static_cast<std::uint8_t>(random.Next());
    link_.PublishBytes(address_.Channel("chunk"), noise);
    link_.PublishBytes(address_.Channel("chunk"), std::span(noise).first(40'000));
  }

  Options options_;
  LcmAddress address_;
  LcmLink link_;
  std::string name_ = fmt::format("faulty-{}", ::getpid());
  std::map<std::int64_t, std::uint64_t> seeds_;  ///< by episode
  std::int64_t sent_ = 0;
};

}  // namespace
}  // namespace evac

int main(int argc, char** argv) {
  evac::FaultyPolicy(evac::Parse(argc, argv), evac::LcmAddress::FromEnvironment()).Run();
}
