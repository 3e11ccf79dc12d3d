#include "worldmodel/sim/draw_process.h"

#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <vector>

#include "core/error.h"

namespace evac::sim {
namespace {

constexpr int kPatienceMs =
    300'000;  ///< for one answer; a picture takes milliseconds, a crowded machine minutes at most

[[noreturn]] void CannotStart(const std::string& what, int error) {
  throw InternalError("cannot render: {}: {}", what, std::strerror(error));
}

int MemoryFile(const char* name, std::size_t bytes) {
  const int fd = ::memfd_create(name, MFD_CLOEXEC);
  if (fd < 0 || ::ftruncate(fd, static_cast<off_t>(bytes)) != 0) CannotStart("no shared memory", errno);
  return fd;
}

/// This process's environment; Mesa's software rasteriser works without threads of its own unless the user wants some:
/// renderers already keep every core busy.
std::vector<char*> Environment() {
  static char no_threads[] = "LP_NUM_THREADS=0";
  std::vector<char*> variables;
  for (char** variable = environ; *variable != nullptr; ++variable) variables.push_back(*variable);
  if (std::getenv("LP_NUM_THREADS") == nullptr) variables.push_back(no_threads);
  variables.push_back(nullptr);
  return variables;
}

/// What posix_spawn is to do in the child: our three descriptors under the numbers it knows, and no other of ours; a
/// process group of its own, so that Ctrl-C is this process's to answer.
class SpawnPlan {
 public:
  SpawnPlan(int socket_fd, int board_fd, int model_fd) {
    posix_spawn_file_actions_init(&actions_);
    posix_spawn_file_actions_adddup2(&actions_, socket_fd, kSocketFd);
    posix_spawn_file_actions_adddup2(&actions_, board_fd, kBoardFd);
    posix_spawn_file_actions_adddup2(&actions_, model_fd, kModelFd);
    posix_spawn_file_actions_addclosefrom_np(&actions_, kModelFd + 1);
    posix_spawnattr_init(&attributes_);
    sigset_t all, none;
    sigfillset(&all);
    sigemptyset(&none);
    posix_spawnattr_setsigdefault(&attributes_, &all);
    posix_spawnattr_setsigmask(&attributes_, &none);
    posix_spawnattr_setpgroup(&attributes_, 0);
    posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK);
  }
  ~SpawnPlan() {
    posix_spawn_file_actions_destroy(&actions_);
    posix_spawnattr_destroy(&attributes_);
  }
  SpawnPlan(const SpawnPlan&) = delete;
  SpawnPlan& operator=(const SpawnPlan&) = delete;

  pid_t Spawn(const std::string& program) const {
    std::string name = program;
    char* const arguments[] = {name.data(), nullptr};
    pid_t pid = -1;
    const int error = ::posix_spawn(&pid, program.c_str(), &actions_, &attributes_, arguments, Environment().data());
    if (error != 0) CannotStart(program, error);
    return pid;
  }

 private:
  posix_spawn_file_actions_t actions_;
  posix_spawnattr_t attributes_;
};

/// A copy of `fd` above the numbers that the child's descriptors get, so that none is overwritten before it is copied.
int Above(int fd) {
  const int copy = ::fcntl(fd, F_DUPFD_CLOEXEC, kModelFd + 1);
  ::close(fd);
  if (copy < 0) CannotStart("no descriptors left", errno);
  return copy;
}

}  // namespace

DrawProcess::DrawProcess() {
  try {
    Start();
    if (const auto how = HearAnswer()) throw InternalError("cannot render: evac-draw {} as it started", *how);
  } catch (...) {
    End();
    throw;
  }
}

DrawProcess::~DrawProcess() { End(); }

void DrawProcess::Start() {
  board_fd_ = Above(MemoryFile("evac-draw board", sizeof(DrawingBoard)));
  model_fd_ = Above(MemoryFile("evac-draw model", 0));
  void* shared = ::mmap(nullptr, sizeof(DrawingBoard), PROT_READ | PROT_WRITE, MAP_SHARED, board_fd_, 0);
  if (shared == MAP_FAILED) CannotStart("no shared memory", errno);
  board_ = static_cast<DrawingBoard*>(shared);
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) CannotStart("no socket", errno);
  socket_fd_ = Above(ends[0]);
  const int theirs = Above(ends[1]);
  try {
    pid_ = SpawnPlan(theirs, board_fd_, model_fd_)
               .Spawn(std::filesystem::read_symlink("/proc/self/exe").parent_path() / "evac-draw");
  } catch (...) {
    ::close(theirs);
    throw;
  }
  ::close(theirs);
}

void DrawProcess::End() {
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);  // it has nothing to lose
    ::waitpid(pid_, nullptr, 0);
  }
  if (board_ != nullptr) ::munmap(board_, sizeof(DrawingBoard));
  for (const int fd : {socket_fd_, model_fd_, board_fd_}) {
    if (fd >= 0) ::close(fd);
  }
}

std::optional<std::string> DrawProcess::Learn(const mjModel& base) {
  mj_saveModel(&base, fmt::format("/proc/self/fd/{}", model_fd_).c_str(), nullptr, 0);
  return Ask(DrawingWord::kLearn);
}

std::optional<std::string> DrawProcess::Draw() { return Ask(DrawingWord::kDraw); }

std::optional<std::string> DrawProcess::Ask(DrawingWord word) {
  if (::send(socket_fd_, &word, 1, MSG_NOSIGNAL) != 1) return HowItDied();
  return HearAnswer();
}

std::optional<std::string> DrawProcess::HearAnswer() {
  pollfd answered{socket_fd_, POLLIN, 0};
  int ready = 0;
  do {
    ready = ::poll(&answered, 1, kPatienceMs);
  } while (ready < 0 && errno == EINTR);
  if (ready == 0) ::kill(pid_, SIGKILL);
  DrawingWord answer{};
  if (ready <= 0 || ::read(socket_fd_, &answer, 1) != 1) return HowItDied();
  if (answer == DrawingWord::kRefused) throw InternalError("{}", static_cast<const char*>(board_->error));
  return std::nullopt;
}

std::string DrawProcess::HowItDied() {
  if (pid_ < 0) return "had ended before";  // a signal to process -1 is one to everybody
  int status = 0;
  ::kill(pid_, SIGKILL);  // if it closed the socket and lives on
  ::waitpid(pid_, &status, 0);
  pid_ = -1;
  if (WIFSIGNALED(status))
    return fmt::format("was ended by signal {} ({})", WTERMSIG(status), ::strsignal(WTERMSIG(status)));
  return fmt::format("ended with exit code {}", WEXITSTATUS(status));
}

}  // namespace evac::sim
