#include "harness/policy_guardian.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>

namespace evac {
namespace {

constexpr int kLook_ms = 20;         ///< how often the guardian looks whether the policy still runs
constexpr int kNotExecutable = 127;  ///< as shells say it

/// Only the policy's own descriptors go with it: other policies' pipes must not be held open here.
void KeepOnly(int& harness_fd, int& log_fd) {
  const int log = ::fcntl(log_fd, F_DUPFD, 10),
            harness = ::fcntl(harness_fd, F_DUPFD, 10);  // above those replaced here
  ::dup2(::open("/dev/null", O_RDONLY), STDIN_FILENO);
  ::dup2(log, STDOUT_FILENO);
  ::dup2(log, STDERR_FILENO);
  ::dup2(harness, 3);
  if (::close_range(4, ~0U, 0) != 0) {  // a kernel before 5.9, or a container that allows no new calls
    rlimit limit{};
    ::getrlimit(RLIMIT_NOFILE, &limit);
    constexpr rlim_t kMost = 1 << 16;
    for (rlim_t fd = 4; fd < std::min(limit.rlim_cur, kMost); ++fd) ::close(static_cast<int>(fd));
  }
  harness_fd = 3;
  log_fd = STDERR_FILENO;
}

void ResetSignals() {
  for (int number = 1; number < NSIG; ++number) ::signal(number, SIG_DFL);
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
}

void Say(const char* text) { (void)!::write(STDERR_FILENO, text, ::strlen(text)); }

[[noreturn]] void BecomeThePolicy(const GuardianOptions& options, pid_t guardian) {
  ::setsid();
  ::close(3);
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != guardian) ::_exit(kNotExecutable);  // it died before the line above
  if (options.working_directory != nullptr && ::chdir(options.working_directory) != 0) {
    Say("cannot enter the working directory ");
    Say(options.working_directory);
    Say("\n");
    ::_exit(kNotExecutable);
  }
  ::execvpe(options.arguments[0], options.arguments, options.environment);
  Say("cannot start ");
  Say(options.arguments[0]);
  Say(": ");
  Say(::strerrordesc_np(errno));
  Say("\n");
  ::_exit(kNotExecutable);
}

/// Sends a signal to every child of this process, in whatever session; those that lost their parent are its children
/// too.
/// @returns whether there was one.
bool SignalChildren(int number) {
  char text[4096];
  const int fd = ::open("/proc/thread-self/children", O_RDONLY | O_CLOEXEC);
  const ssize_t length = fd < 0 ? 0 : ::read(fd, text, sizeof text - 1);
  if (fd >= 0) ::close(fd);
  pid_t child = 0;
  bool is_any = false;
  for (ssize_t i = 0; i < length; ++i) {
    if (text[i] >= '0' && text[i] <= '9') {
      child = 10 * child + (text[i] - '0');
    } else if (child > 0) {
      ::kill(child, number);
      is_any = true;
      child = 0;
    }
  }
  return is_any;
}

void Sleep_ms(int duration_ms) {
  const timespec duration{duration_ms / 1000, (duration_ms % 1000) * 1'000'000L};
  ::nanosleep(&duration, nullptr);
}

/// Whether the policy has ended; others that ended are buried on the way.
bool HasEnded(pid_t policy, int& status) {
  for (;;) {
    int ended_status = 0;
    const pid_t ended = ::waitpid(-1, &ended_status, WNOHANG);
    if (ended <= 0) return ended < 0;
    if (ended == policy) {
      status = ended_status;
      return true;
    }
  }
}

/// Returns when nothing that descends from the policy is left.
void EndAll(pid_t policy, int grace_ms, int& status) {
  ::kill(-policy, SIGTERM);
  SignalChildren(SIGTERM);
  for (int waited_ms = 0; waited_ms < grace_ms && ::kill(-policy, 0) == 0; waited_ms += kLook_ms) {
    HasEnded(policy, status);
    Sleep_ms(kLook_ms);
  }
  ::kill(-policy, SIGKILL);
  for (;;) {  // a killed process hands its own children up to here: again, until there are none
    SignalChildren(SIGKILL);
    int ended_status = 0;
    const pid_t ended = ::waitpid(-1, &ended_status, WNOHANG);
    if (ended == policy) status = ended_status;
    if (ended < 0) return;
    if (ended == 0) Sleep_ms(1);
  }
}

}  // namespace

void Guard(const GuardianOptions& given) {
  GuardianOptions options = given;
  ::setsid();  // Ctrl-C is the harness's to hear
  ::prctl(PR_SET_NAME, "evac-guardian");
  ::prctl(PR_SET_CHILD_SUBREAPER, 1);
  ResetSignals();
  KeepOnly(options.harness_fd, options.log_fd);
  const pid_t guardian = ::getpid();
  const pid_t policy = ::fork();
  if (policy == 0) BecomeThePolicy(options, guardian);
  if (policy < 0) ::_exit(kNotExecutable);

  int status = 0;
  pollfd harness{.fd = options.harness_fd, .events = POLLIN, .revents = 0};
  while (!HasEnded(policy, status) && ::poll(&harness, 1, kLook_ms) <= 0) {
  }
  EndAll(policy, options.grace_ms, status);
  ::_exit(WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status));
}

}  // namespace evac
