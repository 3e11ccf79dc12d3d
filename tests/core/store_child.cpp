// The process that store_kill_test kills: it writes a run until it is stopped.
//   store_child add RUN COUNT     what a run does
//   store_child add_traced RUN    one episode, traced by the parent from the first system call of the adding on
//   store_child fill RUN          until files may not grow; says how many episodes were added, and the error
//   store_child hold RUN          takes the run's lock, says so, waits
#include <fmt/format.h>
#include <sys/ptrace.h>
#include <sys/resource.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <string>

#include "tests/core/store_writing.h"

namespace evac {
namespace {

using namespace samples;

int AddTraced(const std::filesystem::path& run) {
  constexpr int kNotTraced = 98;
  Store store = Store::CreateOrContinue(run, SomeRun());
  if (store.Has(Key(1))) return 0;
  store.RemoveOrphans();
  if (::ptrace(PTRACE_TRACEME, 0, nullptr, nullptr) != 0) return kNotTraced;
  ::raise(SIGSTOP);
  store.Add(SomeEpisode(store, Key(1)));
  return 0;
}

int Fill(const std::filesystem::path& run) {
  std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{400 << 10, 400 << 10};
  if (::setrlimit(RLIMIT_FSIZE, &limit) != 0) return 1;
  const auto [added, message] = AddUntilFull(run, 1000);
  fmt::print("{} {}\n", added, message);
  return 0;
}

int Hold(const std::filesystem::path& run) {
  const Store store = Store::CreateOrContinue(run, SomeRun());
  fmt::print("held\n");
  std::fflush(stdout);
  return ::pause();
}

int Main(int count, char** words) {
  const std::string action = count > 2 ? words[1] : "";
  if (action == "add") return AddMissing(words[2], std::stoi(words[3])), 0;
  if (action == "add_traced") return AddTraced(words[2]);
  if (action == "fill") return Fill(words[2]);
  if (action == "hold") return Hold(words[2]);
  return 2;
}

}  // namespace
}  // namespace evac

int main(int count, char** words) {
  try {
    return evac::Main(count, words);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return 99;
  }
}
