#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>

#include "tests/support/temp_folder.h"
#include "tests/system/process_support.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

using system_test::kFaults;
using system_test::List;
using system_test::RunWords;

CommandResult Shell(const std::string& commands) { return RunCommand({"/bin/sh", "-ec", commands}); }

/// Two machines and a cable between them, as far as the network can tell.
class TwoMachines {
 public:
  TwoMachines() : here_(fmt::format("evac{}a", ::getpid())), there_(fmt::format("evac{}b", ::getpid())) {
    const CommandResult made = Shell(
        fmt::format("ip netns add {0}; ip netns add {1}; ip -n {0} link add cable type veth peer name cable netns {1}\n"
                    "for n in {0}:10.77.0.1 {1}:10.77.0.2; do ip -n ${{n%%:*}} addr add ${{n#*:}}/24 dev cable; ip -n "
                    "${{n%%:*}} link set lo up; "
                    "ip -n ${{n%%:*}} link set cable up; ip -n ${{n%%:*}} route add 224.0.0.0/4 dev cable; done",
                    here_, there_));
    why_not_ = made.exit_code == 0 ? "" : made.err;
  }
  ~TwoMachines() { Shell(fmt::format("ip netns del {} || true; ip netns del {} || true", here_, there_)); }

  const std::string& why_not() const { return why_not_; }
  std::vector<std::string> Here(std::vector<std::string> words) const { return In(here_, std::move(words)); }
  std::vector<std::string> There(std::vector<std::string> words) const { return In(there_, std::move(words)); }

 private:
  static std::vector<std::string> In(const std::string& machine, std::vector<std::string> words) {
    words.insert(words.begin(), {"/bin/ip", "netns", "exec", machine});
    return words;
  }
  std::string here_, there_, why_not_;
};

std::string Url(int ttl) { return fmt::format("udpm://239.255.76.67:7733?ttl={}&recv_buf_size=4194304", ttl); }

std::vector<std::string> Joining(const std::filesystem::path& run, int ttl) {
  return RunWords(kFaults, run,
                  {fmt::format("policies.0={{name: visual_pick, join: {{url: \"{}\", token: there}}}}", Url(ttl)),
                   "initial_states.count=1", "transport={deadline_s: 60, start_s: 20}"});
}

TEST(Networks, APolicyOnAnotherMachineIsJoinedByUrlAndTtlAndTheRunIsTheSameAsOnOne) {
  const TempFolder folder;
  const TwoMachines machines;
  if (!machines.why_not().empty()) GTEST_SKIP() << "two network namespaces need root: " << machines.why_not();
  const auto policy = [&](int ttl) {
    return std::vector<std::string>{
        Binary("evac-policy"), "visual_pick", "--url", Url(ttl), "--token", "there", "--chunk-size", "8"};
  };
  const pid_t there = StartCommand(machines.There(policy(1)), folder / "there.log");
  const CommandResult across = RunCommand(machines.Here(Joining(folder / "across", 1)));
  EXPECT_EQ(across.exit_code, 0) << across.err;
  std::vector<std::string> words = Joining(folder / "not_found", 0);
  words.insert(words.end(), {"--set", "transport.start_s=2"});
  const CommandResult not_found = RunCommand(machines.Here(words));
  EXPECT_EQ(not_found.exit_code, 2);
  EXPECT_THAT(not_found.err, testing::HasSubstr("no policy answered within 2 s on " + Url(0)));
  ::kill(there, SIGTERM);
  ::waitpid(there, nullptr, 0);

  const pid_t beside = StartCommand(machines.Here(policy(0)), folder / "beside.log");
  const CommandResult alone = RunCommand(machines.Here(Joining(folder / "alone", 0)));
  EXPECT_EQ(alone.exit_code, 0) << alone.err;
  ::kill(beside, SIGTERM);
  ::waitpid(beside, nullptr, 0);
  EXPECT_EQ(List(folder / "across"), List(folder / "alone"));
}

}  // namespace
}  // namespace evac
