#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <unistd.h>

#include <fstream>

#include "core/file.h"
#include "core/store.h"
#include "harness/job.h"
#include "tests/support/temp_folder.h"
#include "tests/system/process_support.h"
#include "tests/system/run_support.h"

namespace evac {
namespace {

using system_test::kFaults;
using system_test::List;
using system_test::Mark;
using system_test::RunWords;
using system_test::WaitUntil;
using Clock = std::chrono::steady_clock;

/// On a terminal of its own: closing `terminal` is what closing its window is. @returns the process.
pid_t StartOnTerminal(const std::vector<std::string>& words, int& terminal) {
  std::vector<char*> arguments;
  for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  const pid_t pid = ::forkpty(&terminal, nullptr, nullptr, nullptr);
  if (pid != 0) return pid;
  HearInterrupts();
  ::execv(arguments[0], arguments.data());
  ::_exit(127);
}

double SecondsSince(Clock::time_point then) { return std::chrono::duration<double>(Clock::now() - then).count(); }

/// The bottle's page under that many names: what a world must try out before its first episode. @returns a YAML list.
std::string PagesOfManyTasks(const std::filesystem::path& folder, int count) {
  const std::filesystem::path scenes = EVAC_SOURCE_DIR "/worldmodel/sim/scenes";
  std::filesystem::copy(scenes, folder, std::filesystem::copy_options::recursive);
  const std::string page = ReadFile(scenes / "take_bottle.yaml"), id = "id: take_bottle\n";
  std::string list;
  for (int i = 0; i < count; ++i) {
    std::string other = page;
    other.replace(other.find(id), id.size(), fmt::format("id: take_bottle_{}\n", i));
    const std::filesystem::path file = folder / fmt::format("take_bottle_{}.yaml", i);
    std::ofstream(file) << other;
    list += (list.empty() ? "" : ", ") + file.string();
  }
  return "[" + list + "]";
}

TEST(Interrupts, WhileTheWorldTriesOutItsTasksItDoesNotTryTheOthersFirst) {
  const TempFolder folder;
  const Mark mark(folder.path().string());
  const std::string tasks = PagesOfManyTasks(folder / "pages", 150);
  double seconds[2] = {};  // until all were tried and an episode began; until it ended, interrupted at the first
  for (const bool is_interrupted : {false, true}) {
    const std::filesystem::path run = folder / (is_interrupted ? "run" : "whole");
    const std::filesystem::path log = run.string() + ".log";
    const pid_t pid = StartCommand(RunWords(kFaults, run, {"tasks=" + tasks}), log);
    ASSERT_TRUE(WaitUntil([&] { return !mark.Processes("evac-draw").empty(); }));
    const auto before = Clock::now();
    if (!is_interrupted) {
      ASSERT_TRUE(WaitUntil([&] { return std::filesystem::exists(run / "videos"); }, 600));
      seconds[0] = SecondsSince(before);
    }
    ::kill(pid, SIGINT);
    int status = 0;
    ::waitpid(pid, &status, 0);
    seconds[1] = SecondsSince(before);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 4) << status;
    EXPECT_NE(ReadFile(log).find("interrupted"), std::string::npos) << ReadFile(log);
    EXPECT_TRUE(WaitUntil([&] { return mark.Processes().empty(); })) << "something is left running";
  }
  EXPECT_LT(seconds[1], seconds[0] / 2) << "of " << seconds[0] << " s for all";
}

/// A run whose episodes all failed, and are to run again.
class FailedRun {
 public:
  explicit FailedRun(int states) {
    FailBy("error");
    EXPECT_EQ(RunCommand(RunWords(kFaults, run_, {"policies.0.command=[/bin/sh, " + script_.string() + "]",
                                                  "transport.deadline_s=600",
                                                  fmt::format("initial_states.count={}", states)}))
                  .exit_code,
              0);
  }

  const std::filesystem::path& run() const { return run_; }

  /// The policy does so from its next start on.
  void FailBy(const std::string& fault) const {
    std::ofstream(script_) << "exec '" << Binary("faulty-policy") << "' --fault " << fault << "\n";
  }

  /// `evac resume --retry-failed`, interrupted once the policy has said a word.
  void RetryUntil(const char* word) const {
    const std::filesystem::path policys_log = run_ / "logs/faulty@default.log", log = folder_ / "resume.log";
    const pid_t pid = StartCommand({Binary("evac"), "resume", run_.string(), "--retry-failed"}, log);
    EXPECT_TRUE(WaitUntil([&] { return ReadFile(policys_log).find(word) != std::string::npos; })) << ReadFile(log);
    ::kill(pid, SIGINT);
    int status = 0;
    ::waitpid(pid, &status, 0);
    EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 4) << status;
  }

 private:
  TempFolder folder_;
  std::filesystem::path run_ = folder_ / "run", script_ = folder_ / "policy.sh";
};

/// The rows were gone, with their reasons, and nothing ran again.
TEST(Interrupts, WhileThePolicyIsTriedFailedEpisodesThatWereToRunAgainStay) {
  const FailedRun failed(1);
  const std::string before = List(failed.run());
  EXPECT_NE(before.find("policy_error"), std::string::npos) << before;
  failed.FailBy("silent");
  failed.RetryUntil("is silent");
  EXPECT_EQ(List(failed.run()), before);
}

/// All of a pairing's were gone when the first of them began.
TEST(Interrupts, FailedEpisodesThatDidNotRunAgainYetKeepTheirReasons) {
  const FailedRun failed(3);
  Job second;
  second.key = {{"take_bottle", "3-0001", "faulty", "default", 1}, "real"};
  failed.FailBy(fmt::format("hang@{}", second.PolicySeed()));
  failed.RetryUntil("hangs");
  std::vector<StopReason> stops;
  for (const Episode& episode : Store::Open(failed.run(), Store::Mode::kReadOnly).Episodes())
    stops.push_back(episode.stop);
  EXPECT_EQ(stops, (std::vector<StopReason>{StopReason::kStill, StopReason::kPolicyError, StopReason::kPolicyError}));
}

struct Interruption {
  const char* name;
  int signal;           ///< 0: the terminal is closed
  const char* command;  ///< of the policy
};

void PrintTo(const Interruption& interruption, std::ostream* out) { *out << interruption.name; }

class Interrupted : public testing::TestWithParam<Interruption> {};

TEST_P(Interrupted, StopsLongBeforeADeadlineLeavesNothingRunningAndGoesOnWhereItWas) {
  const TempFolder folder;
  const Mark mark(folder.path().string());
  std::ofstream(folder / "sick") << "yes";
  const std::string command = fmt::format(fmt::runtime(GetParam().command), (folder / "sick").string());
  const bool hangs = command != "faulty-policy";
  const std::filesystem::path videos = folder / "run/videos/real/take_bottle/faulty@default";
  int terminal = -1;
  const pid_t pid = StartOnTerminal(
      RunWords(kFaults, folder / "run",
               {"policies.0.command=[" + command + "]", "transport.deadline_s=60", "initial_states.count=3"}),
      terminal);
  ::fcntl(terminal, F_SETFL, O_NONBLOCK);
  std::string said(4096, '\0');
  ASSERT_TRUE(WaitUntil([&] {
    while (::read(terminal, said.data(), said.size()) > 0) {  // or it blocks on a full terminal
    }
    return std::filesystem::exists(videos / (hangs ? "3-0000-s1.mp4.tmp" : "3-0001-s1.mp4.tmp"));
  }));
  const std::filesystem::path log = folder / "run/logs/faulty@default.log";
  ASSERT_TRUE(!hangs || WaitUntil([&] { return ReadFile(log).find("hangs") != std::string::npos; }))
      << "it never came to the request that it does not answer";
  const auto before = Clock::now();
  const bool is_ctrl_c = GetParam().signal == SIGINT;
  EXPECT_EQ(is_ctrl_c ? ::write(terminal, "\x03", 1) : 1, 1);  // reaches all of the terminal's processes
  if (GetParam().signal == SIGTERM) ::kill(pid, SIGTERM);
  if (GetParam().signal == 0) ::close(terminal);
  int status = 0;
  ASSERT_TRUE(WaitUntil([&] {
    while (GetParam().signal != 0 && ::read(terminal, said.data(), said.size()) > 0) {
    }
    return ::waitpid(pid, &status, WNOHANG) == pid;
  }));
  EXPECT_LT(SecondsSince(before), 30) << "one that hangs would be waited for for 60 s, its deadline";
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 4) << status << ": it went through";
  EXPECT_TRUE(WaitUntil([&] { return mark.Processes().empty(); })) << "something is left running";
  if (GetParam().signal != 0) ::close(terminal);

  std::filesystem::remove(folder / "sick");
  const CommandResult resumed = RunCommand({Binary("evac"), "resume", (folder / "run").string()});
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  static const std::string whole = [] {
    const TempFolder other;
    EXPECT_EQ(RunCommand(RunWords(kFaults, other / "run", {"initial_states.count=3"})).exit_code, 0);
    return List(other / "run");
  }();
  EXPECT_EQ(List(folder / "run"), whole);
}

INSTANTIATE_TEST_SUITE_P(
    By, Interrupted,
    testing::Values(Interruption{"CtrlC", SIGINT, "faulty-policy"}, Interruption{"Sigterm", SIGTERM, "faulty-policy"},
                    Interruption{"ClosedTerminal", 0, "faulty-policy"},
                    Interruption{"CtrlCWhileThePolicyHangs", SIGINT, "faulty-policy, --fault, hang, --while, {}"}),
    [](const testing::TestParamInfo<Interruption>& info) { return info.param.name; });

/// On waking, all that waited had timed out, and the policy was ended as one that hangs.
TEST(Interrupts, ARunThatIsSuspendedForLongerThanADeadlineGoesOnWhereItWas) {
  const TempFolder folder;
  const Mark mark(folder.path().string());
  const std::filesystem::path run = folder / "run", log = run / "logs/faulty@default.log";
  const pid_t pid = StartCommand(RunWords(kFaults, run,
                                          {"policies.0.command=[faulty-policy, --fault, late, --late-s, \"6\"]",
                                           "transport={deadline_s: 15, repeat_after_s: 60}", "initial_states.count=1"}),
                                 folder / "run.log");
  const bool is_waiting = WaitUntil(
      [&] { return std::filesystem::exists(log) && ReadFile(log).find("is late") != std::string::npos; });
  EXPECT_TRUE(is_waiting) << "it never came to the request that it answers late";
  const std::vector<pid_t> all = mark.Processes();
  for (const pid_t process : all) ::kill(process, SIGSTOP);
  std::this_thread::sleep_for(std::chrono::seconds(17));
  for (const pid_t process : all) ::kill(process, SIGCONT);
  int status = 0;
  ::waitpid(pid, &status, 0);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  const std::string episodes = List(run);
  EXPECT_EQ(episodes.find("policy_timeout"), std::string::npos) << episodes;
}

}  // namespace
}  // namespace evac
