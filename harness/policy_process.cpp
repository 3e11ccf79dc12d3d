#include "harness/policy_process.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <deque>
#include <fstream>
#include <utility>

#include "core/error.h"
#include "harness/policy_guardian.h"

extern char** environ;

namespace evac {
namespace {

using Clock = std::chrono::steady_clock;

/// @param from  what stands before it was said by an earlier process
std::string LastLine(const std::filesystem::path& log, std::streamoff from) {
  constexpr std::streamoff kTail = 4096;
  std::ifstream file(log, std::ios::ate);
  file.seekg(std::max<std::streamoff>(from, file.tellg() - kTail));
  std::string line, last;
  while (std::getline(file, line)) {
    if (!line.empty()) last = line;
  }
  return last.empty() ? "it said nothing" : last;
}

std::string HowItEnded(int status) {
  constexpr int kSignals = 128;  // the guardian, as shells do, says 128 + n where signal n ended the policy
  const int number = WIFSIGNALED(status) ? WTERMSIG(status) : WEXITSTATUS(status) - kSignals;
  const char* description = number > 0 ? ::sigdescr_np(number) : nullptr;
  if (description != nullptr) return fmt::format("signal {} ({})", number, description);
  return fmt::format("exit code {}", WEXITSTATUS(status));
}

/// A command that cannot be found, or refuses its options (2, as everywhere), will do so again.
bool IsHopeless(int status) { return WIFEXITED(status) && (WEXITSTATUS(status) == 127 || WEXITSTATUS(status) == 2); }

/// The harness's environment with `additions` in place of what they name.
std::vector<std::string> Environment(const std::map<std::string, std::string>& additions) {
  std::vector<std::string> entries;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    const std::string text = *entry;
    if (!additions.contains(text.substr(0, text.find('=')))) entries.push_back(text);
  }
  for (const auto& [name, value] : additions) entries.push_back(fmt::format("{}={}", name, value));
  return entries;
}

std::vector<char*> Pointers(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

int OpenLog(const std::filesystem::path& log) {
  const int fd = ::open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
  if (fd < 0) throw InvalidInput("policy log {}: {}", log.string(), std::strerror(errno));
  return fd;
}

}  // namespace

PolicyProcess::PolicyProcess(PolicyProcessOptions options) : options_(std::move(options)) {
  if (options_.command.empty()) throw InvalidInput("a policy's command is empty, wanted a program and its arguments");
  ::close(OpenLog(options_.log));
  options_.environment.insert_or_assign("EVAC_SUPERVISED",
                                        std::string("1"));  // it may end itself when its parent is gone
  supervisor_ = std::thread([this] {
    try {
      Supervise();
    } catch (const std::exception& error) {
      const std::lock_guard lock(mutex_);
      why_gone_ = error.what();
    }
  });
}

PolicyProcess::~PolicyProcess() { Stop(); }

void PolicyProcess::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
    if (alive_pipe_ >= 0) ::close(std::exchange(alive_pipe_, -1));  // the guardian sees it and ends everything
  }
  stopping_changed_.notify_all();
  if (supervisor_.joinable()) supervisor_.join();
}

void PolicyProcess::Restart(Clock::time_point asked) {
  const std::lock_guard lock(mutex_);
  if (alive_pipe_ < 0 || started_ > asked) return;
  ::close(std::exchange(alive_pipe_, -1));  // the guardian ends it; Supervise sees a death
  was_silent_ = true;
}

std::optional<std::string> PolicyProcess::WhyGone() const {
  const std::lock_guard lock(mutex_);
  return why_gone_;
}

int PolicyProcess::restarts() const {
  const std::lock_guard lock(mutex_);
  return restarts_;
}

/// Runs the command again and again until Stop, or until it has died too often within the window.
void PolicyProcess::Supervise() {
  std::deque<Clock::time_point> deaths;
  double back_off_s = options_.first_restart_after_s;
  for (;;) {
    const Clock::time_point started = Clock::now();
    const int status = RunOnce();
    const Clock::time_point died = Clock::now();
    const auto window = std::chrono::duration<double>(options_.window_s);
    if (died - started > window) back_off_s = options_.first_restart_after_s;
    deaths.push_back(died);
    while (died - deaths.front() > window) deaths.pop_front();

    std::unique_lock lock(mutex_);
    if (stopping_) return;
    const bool is_hopeless = IsHopeless(status) && !was_silent_;
    if (is_hopeless || static_cast<int>(deaths.size()) > options_.restarts)
      return GiveUp(static_cast<int>(deaths.size()), status);
    if (stopping_changed_.wait_for(lock, std::chrono::duration<double>(back_off_s), [this] { return stopping_; }))
      return;
    back_off_s = std::min(2 * back_off_s, options_.longest_back_off_s);
    ++restarts_;
  }
}

/// @returns wait status of the guardian, which ends as the policy did.
int PolicyProcess::RunOnce() {
  std::vector<std::string> words = options_.command, entries = Environment(options_.environment);
  const std::vector<char*> arguments = Pointers(words), environment = Pointers(entries);
  int alive[2];
  const int log = OpenLog(options_.log);
  log_before_ = ::lseek(log, 0, SEEK_END);
  if (::pipe2(alive, O_CLOEXEC) != 0) throw InternalError("cannot make a pipe: {}", std::strerror(errno));
  const GuardianOptions guardian{
      .arguments = arguments.data(),
      .environment = environment.data(),
      .working_directory = options_.working_directory.empty() ? nullptr : options_.working_directory.c_str(),
      .log_fd = log,
      .harness_fd = alive[0],
      .grace_ms = static_cast<int>(options_.grace_s * 1000)};
  std::unique_lock lock(mutex_);
  const pid_t child = stopping_ ? -1 : ::fork();
  if (child == 0) Guard(guardian);  // does not return
  ::close(log);
  ::close(alive[0]);
  if (child < 0) {
    ::close(alive[1]);
    if (stopping_) return 0;
    throw InternalError("cannot start {}: {}", options_.command.front(), std::strerror(errno));
  }
  alive_pipe_ = alive[1];
  was_silent_ = false;
  started_ = Clock::now();
  lock.unlock();

  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  lock.lock();
  if (alive_pipe_ >= 0) ::close(std::exchange(alive_pipe_, -1));
  return status;
}

/// With `mutex_` held.
void PolicyProcess::GiveUp(int deaths, int status) {
  const std::string how = was_silent_ ? "by evac because it was silent" : "with " + HowItEnded(status);
  why_gone_ = fmt::format("its process ended {} within {} s, at last {}: {} ({})",
                          deaths == 1 ? "once" : fmt::format("{} times", deaths), options_.window_s, how,
                          LastLine(options_.log, log_before_), options_.log.string());
}

}  // namespace evac
