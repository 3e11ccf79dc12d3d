#include "core/in_child.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>

#include "core/error.h"

namespace evac {
namespace {

constexpr rlim_t kPatience_s = 60;  // of processor time
constexpr char kDone = 'd', kRefused = 'r';

/// What an Error is beside its message. Its kind is a literal, which lies at the same place in the child and here.
struct Refusal {
  ExitCode exit_code = ExitCode::kInvalidInput;
  const char* kind = "";
};

std::string Packed(const Refusal& refusal, const std::string& message) {
  std::string bytes(1, kRefused);
  bytes.append(reinterpret_cast<const char*>(&refusal), sizeof refusal);
  return bytes.append(message);
}

[[noreturn]] void ThrowUnpacked(const std::string& bytes) {
  Refusal refusal;
  std::memcpy(&refusal, bytes.data() + 1, sizeof refusal);
  throw Error(refusal.exit_code, bytes.substr(1 + sizeof refusal)).Called(refusal.kind);
}

void WriteAll(int fd, const std::string& bytes) {
  for (std::size_t at = 0; at < bytes.size();) {
    const ssize_t written = ::write(fd, bytes.data() + at, bytes.size() - at);
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) ::_exit(1);
    at += static_cast<std::size_t>(written);
  }
}

/// A crash here is an answer, not an incident: no handler of this program is told, no core is left.
[[noreturn]] void BeTheChild(int fd, pid_t parent, const std::function<std::string()>& work) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(1);
  for (const int signal : {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT, SIGXCPU, SIGPIPE}) ::signal(signal, SIG_DFL);
  const rlimit no_core{0, 0}, patience{kPatience_s, kPatience_s + 5};  // SIGXCPU comes before SIGKILL
  ::setrlimit(RLIMIT_CORE, &no_core);
  ::setrlimit(RLIMIT_CPU, &patience);
  try {
    WriteAll(fd, kDone + work());
  } catch (const Error& error) {
    WriteAll(fd, Packed({error.exit_code(), error.kind()}, error.what()));
  } catch (const std::exception& error) {
    WriteAll(fd, Packed({}, error.what()));
  }
  ::_exit(0);
}

std::string ReadAll(int fd) {
  std::string bytes;
  char piece[1 << 16];
  for (;;) {
    const ssize_t count = ::read(fd, piece, sizeof piece);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return bytes;
    bytes.append(piece, static_cast<std::size_t>(count));
  }
}

}  // namespace

std::string InChild(const std::string& what, const std::function<std::string()>& work) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0)
    throw InternalError("{}: no pipe to read it through: {}", what, std::strerror(errno));
  const pid_t parent = ::getpid(), child = ::fork();
  if (child == 0) BeTheChild(ends[1], parent, work);
  const int error = errno;
  ::close(ends[1]);
  std::string answer = child < 0 ? "" : ReadAll(ends[0]);
  ::close(ends[0]);
  if (child < 0) throw InternalError("{}: no process to read it in: {}", what, std::strerror(error));
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (WIFSIGNALED(status) && (WTERMSIG(status) == SIGKILL || WTERMSIG(status) == SIGTERM || WTERMSIG(status) == SIGINT))
    throw InternalError("{}: the process that read it was stopped from outside, by signal {} (out of memory?)", what,
                        WTERMSIG(status));
  if (WIFSIGNALED(status))
    throw InvalidInput("{}: a broken file: reading it ended with signal {} ({})", what, WTERMSIG(status),
                       ::strsignal(WTERMSIG(status)));
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0 || answer.empty())
    throw InvalidInput("{}: a broken file: reading it ended with status {}", what, status);
  if (answer.front() == kRefused) ThrowUnpacked(answer);
  return answer.substr(1);
}

}  // namespace evac
