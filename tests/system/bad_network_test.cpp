#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include "core/file.h"
#include "core/seed.h"
#include "core/store.h"
#include "tests/support/temp_folder.h"
#include "tests/support/udp_relay.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

using system_test::kFaults;
using system_test::List;
using system_test::RunWords;
using testing::HasSubstr;

/// `evac run` with a policy that is reached through `policy_url`, of two episodes that depend on every image.
CommandResult RunJoining(const std::filesystem::path& run, const std::string& url) {
  return RunCommand(
      RunWords(kFaults, run,
               {fmt::format("policies.0={{name: visual_pick, join: {{url: \"{}\", token: relay}}}}", url),
                "initial_states.count=2", "lanes=2", "transport={deadline_s: 120, repeat_after_s: 0.05}"}));
}

class ServedElsewhere {
 public:
  ServedElsewhere(const std::string& url, const std::filesystem::path& log)
      : pid_(StartCommand({Binary("evac-policy"), "visual_pick", "--url", url, "--token", "relay", "--chunk-size", "8"},
                          log)) {}
  ~ServedElsewhere() {
    ::kill(pid_, SIGTERM);
    ::waitpid(pid_, nullptr, 0);
  }

 private:
  pid_t pid_;
};

class BadNetwork : public testing::TestWithParam<int> {};

TEST_P(BadNetwork, LossReorderingDuplicationAndDelayChangeNothingButTheCountersWhichAreShown) {
  const TempFolder folder;
  SplitMix64 random(static_cast<std::uint64_t>(::getpid()));
  const int port_a = 30000 + static_cast<int>(random.Below(1000)) * 2,
            port_b = port_a + 1;  // no run of ours uses these
  const double share = GetParam() / 100.0;
  UdpRelay relay({port_a, port_b, share, share, 0.02, 7});
  const ServedElsewhere policy(UdpRelay::Url(port_b), folder / "policy.log");

  static const std::string straight = [&] {
    const CommandResult result = RunJoining(folder / "straight", UdpRelay::Url(port_b));
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return List(folder / "straight");
  }();
  const CommandResult through = RunJoining(folder / "through", UdpRelay::Url(port_a));
  ASSERT_EQ(through.exit_code, 0) << through.err;
  EXPECT_EQ(List(folder / "through"), straight);

  const UdpRelay::Counts counts = relay.Stop();
  EXPECT_GT(counts.lost, 0);
  EXPECT_GT(counts.doubled, 0);
  EXPECT_GT(counts.overtaken, 0);
  const auto counters = Store::Open(folder / "through", Store::Mode::kReadOnly).CountersByPolicy();
  const auto repeats = counters.at("visual_pick@default").at("repeats");
  EXPECT_GT(repeats, 0);
  const std::string shown = fmt::format("{} repeats", repeats);
  EXPECT_THAT(through.err, HasSubstr(shown));
  EXPECT_THAT(RunCommand({Binary("evac"), "ls", (folder / "through").string()}).out, HasSubstr(shown));
  ASSERT_EQ(RunCommand({Binary("evac"), "report", (folder / "through").string()}).exit_code, 0);
  EXPECT_THAT(ReadFile(folder / "through/report/index.html"), HasSubstr(fmt::format(">{}</td>", repeats)));
}

INSTANTIATE_TEST_SUITE_P(Percent, BadNetwork, testing::Values(5, 30));

}  // namespace
}  // namespace evac
