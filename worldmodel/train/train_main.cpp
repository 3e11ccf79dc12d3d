#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "worldmodel/nn/library.h"
#include "worldmodel/nn/memory.h"
#include "worldmodel/nn/number_text.h"
#include "worldmodel/nn/open_blas.h"
#include "worldmodel/nn/threads.h"
#include "worldmodel/train/sha256.h"
#include "worldmodel/train/training_job.h"

/// evac-train: a training that `evac train … --job` wrote, on a machine that has a compiler and libtorch alone.
namespace {

using namespace evac;
using namespace evac::train;

constexpr const char* kUsage =
    R"(evac-train JOB SHARDS... --out OUT [--codec FILE] [--init FILE] [--forecast FILE] [--device cpu|cuda|cuda:N]
           [--threads N] [--steps N]

Does the training that `evac train codec|world … --job JOB` wrote (docs/train_on_gpu.md), with the shards and the weights
that were named then, wherever they lie now. Killed, the same command goes on from OUT/training.safetensors.
OUT: codec.safetensors or weights.safetensors, metrics.csv, holdout.csv, curves.svg, strips/*.ppm (of a world model).
Ends with 0, 2 where the input is wrong, 4 where the machine is or somebody interrupted.
)";

struct Arguments {
  std::filesystem::path job, out, codec, init, forecast;
  ShardFolders shards;
  at::Device device = at::kCPU;
  int threads = 0;
  std::int64_t steps = 0;
};

std::int64_t Whole(const std::string& option, const std::string& text, std::int64_t most) {
  std::int64_t value = 0;
  if (!nn::ParseNumber(text, value) || value < 1 || value > most)
    throw TensorError(option + ": found '" + text + "', wanted 1 to " + std::to_string(most));
  return value;
}

at::Device DeviceOf(const std::string& text) {
  if (text == "cpu") return at::kCPU;
  const std::string number = text.starts_with("cuda:") ? text.substr(5) : "0";
  if (text != "cuda" && !text.starts_with("cuda:"))
    throw TensorError("--device: found '" + text + "', wanted cpu, cuda or cuda:N");
  if (!nn::HasCuda()) throw TensorError("--device " + text + ": this libtorch finds no GPU here; wanted cpu");
  const std::int64_t index = number == "0" ? 0 : Whole("--device cuda:N", number, 127);
  return at::Device(at::kCUDA, static_cast<at::DeviceIndex>(index));
}

Arguments Read(const std::vector<std::string>& words) {
  Arguments arguments;
  std::vector<std::filesystem::path> places;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (!word.starts_with("--")) {
      places.emplace_back(word);
      continue;
    }
    if (i + 1 == words.size()) throw TensorError(word + ": nothing follows it");
    const std::string& value = words[++i];
    if (word == "--out") arguments.out = value;
    else if (word == "--codec") arguments.codec = value;
    else if (word == "--init") arguments.init = value;
    else if (word == "--forecast") arguments.forecast = value;
    else if (word == "--device") arguments.device = DeviceOf(value);
    else if (word == "--threads") arguments.threads = static_cast<int>(Whole(word, value, 1024));
    else if (word == "--steps") arguments.steps = Whole(word, value, std::int64_t{1} << 40);
    else throw TensorError(word + ": there is no such option; evac-train --help says which there are");
  }
  if (places.size() < 2) throw TensorError("found " + std::to_string(places.size()) + " names, wanted JOB and SHARDS");
  if (arguments.out.empty()) throw TensorError("--out is missing: the folder to write");
  arguments.job = places.front();
  arguments.shards.assign(places.begin() + 1, places.end());
  return arguments;
}

void RequireFile(const char* option, const std::filesystem::path& given, bool wanted) {
  if (wanted && given.empty()) throw TensorError(std::string(option) + " is missing: the job begins with such weights");
  if (!wanted && !given.empty()) throw TensorError(std::string(option) + ": the job was written without it");
}

/// @param identity  of a file, as the job has it: begun with others the training would be another one
void RequireSame(const char* option, const std::filesystem::path& given, const std::string& wanted,
                 std::string (*identity)(const std::filesystem::path&)) {
  if (given.empty() || wanted.empty()) return;  // the job is of an earlier version
  if (const std::string found = identity(given); found != wanted)
    throw TensorError(std::string(option) + ": " + given.string() +
                      " is another one than the job was written for: SHA-256 " + found + ", wanted " + wanted);
}

/// What one packing holds out another might learn from: of the job's own that was asked where it was written.
void RequireSameShards(const ShardFolders& shards, const std::string& wanted) {
  if (wanted.empty()) return;  // the job is of an earlier version
  if (const std::string found = RecipesOf(shards); found != wanted)
    throw TensorError("SHARDS: they are others than the job was written for, or in another order: recipe " + found +
                      ", wanted " + wanted);
}

/// One process in OUT, as long as it lives: it holds OUT/lock as `evac train` does (core/store_lock.h, which is not
/// built here), so that the two do not write one another's files either.
class Hold {
 public:
  explicit Hold(const std::filesystem::path& out) {
    std::error_code error;
    std::filesystem::create_directories(out, error);
    const std::string file = (out / "lock").string();
    descriptor_ = ::open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC | O_NOFOLLOW, 0644);
    if (descriptor_ < 0) throw TensorError(file + ": cannot be made: " + std::strerror(errno));
    std::array<char, 17> text{};
    const ssize_t size = ::read(descriptor_, text.data(), text.size());
    const std::string holder(text.data(), size > 0 ? static_cast<std::size_t>(size) : 0);
    if (size < 0 || holder.size() == text.size() || holder.find_first_not_of("0123456789\n") != std::string::npos)
      throw TensorError(file + ": is no lock of evac's, wanted that name free, or another folder");
    if (::flock(descriptor_, LOCK_EX | LOCK_NB) != 0)
      throw TensorError(out.string() + ": process " + holder.substr(0, holder.find('\n')) +
                        " is writing here; wait for it or stop it");
    const std::string own = std::to_string(::getpid()) + "\n";
    if (::ftruncate(descriptor_, 0) != 0 || ::pwrite(descriptor_, own.data(), own.size(), 0) < 0) {
      // Only the message to a second process is poorer for it.
    }
  }
  ~Hold() { ::close(descriptor_); }
  Hold(const Hold&) = delete;
  Hold& operator=(const Hold&) = delete;

 private:
  int descriptor_ = -1;
};

/// OUT/begun_by, as `evac train` writes it: where another version began the training, a note says so.
void KeepWhoBegan(const std::filesystem::path& out) {
  const std::filesystem::path file = out / "begun_by";
  if (!std::filesystem::exists(out / "training.safetensors")) {
    std::ofstream text(file, std::ios::binary | std::ios::trunc);
    text << EVAC_TRAIN_VERSION "\n" << std::flush;
    if (!text) throw TensorWriteError(file.string() + ": cannot be written");
    return;
  }
  std::string began;
  std::ifstream text(file);
  std::getline(text, began);
  if (began == EVAC_TRAIN_VERSION) return;
  began = began.empty() ? "an evac that did not write down its version" : "evac " + began;
  std::fprintf(stderr, "evac-train: note: %s was begun by %s; evac " EVAC_TRAIN_VERSION " goes on with it\n",
               out.c_str(), began.c_str());
}

volatile std::sig_atomic_t g_interrupted = 0;

void CatchInterrupts() {
  struct sigaction action = {};
  action.sa_handler = [](int) { g_interrupted = 1; };
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction before = {};
    ::sigaction(signal, nullptr, &before);
    if (before.sa_handler != SIG_IGN) ::sigaction(signal, &action, nullptr);  // nohup
  }
}

void ShowNowAndThen(const TrainerProgress& progress) {
  static std::chrono::steady_clock::time_point next;
  if (std::chrono::steady_clock::now() < next) return;
  next = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  std::fprintf(stderr, "%s\n", progress.Line().c_str());
}

/// OUT/strips/step_00001200.ppm
void WriteStrips(const std::filesystem::path& out, std::int64_t step, const Strips& strips) {
  std::filesystem::create_directories(out / "strips");
  char name[40];
  std::snprintf(name, sizeof name, "step_%08lld.ppm", static_cast<long long>(step));
  const at::Tensor picture = strips.picture.contiguous();
  std::ofstream file(out / "strips" / name, std::ios::binary | std::ios::trunc);
  file << "P6\n" << picture.size(1) << " " << picture.size(0) << "\n255\n";
  file.write(static_cast<const char*>(picture.data_ptr()), static_cast<std::streamsize>(picture.nbytes()));
}

int Train(const Arguments& arguments) {
  TrainingJob job = ReadTrainingJob(arguments.job);
  const bool is_codec = job.kind == TrainingKind::kCodec;
  RequireFile("--codec", arguments.codec, !is_codec);
  RequireFile("--init", arguments.init, job.wants_init);
  RequireFile("--forecast", arguments.forecast, job.wants_forecast);
  RequireSame("--codec", arguments.codec, job.start.codec_sha256, CodecSha256);
  RequireSame("--init", arguments.init, job.init_sha256, Sha256OfFile);
  RequireSame("--forecast", arguments.forecast, job.forecast_sha256, Sha256OfFile);
  RequireSameShards(arguments.shards, job.recipe);
  for (JobOptions* options : {&job.codec.job, &job.world.job}) {
    if (arguments.steps == 0) continue;
    options->trainer.steps = arguments.steps;
    options->trainer.minutes = 0;
  }
  CheckOptions(job.options().trainer);
  const int cores = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
  const int threads = arguments.threads > 0 ? arguments.threads : cores;
  const JobPlace place{arguments.shards, arguments.out, job.config, threads, [] { return g_interrupted != 0; },
                       ShowNowAndThen, [](const std::string& sentence) { std::fprintf(stderr, "%s\n", sentence.c_str()); },
                       job.begun_with, arguments.device};
  job.start.codec = arguments.codec;
  job.start.init = arguments.init;
  job.start.forecast = arguments.forecast;
  if (is_codec) CheckCodecTraining(place, job.codec, arguments.init);  // before OUT is made
  else CheckWorldTraining(place, job.world, job.start);
  const Hold hold(arguments.out);
  KeepWhoBegan(arguments.out);
  CatchInterrupts();
  nn::KeepFreedMemory();
  const nn::LibraryThreads library(Workers(place, job.options()) > 1 ? 1 : threads);
  const auto look = [&](std::int64_t step, const Strips& strips) { WriteStrips(arguments.out, step, strips); };
  const TrainerSummary summary =
      is_codec ? TrainCodec(place, job.codec, arguments.init) : TrainWorld(place, job.world, job.start, look);
  const char* file = is_codec ? "codec.safetensors" : "weights.safetensors";
  if (!summary.IsDone()) {
    std::fprintf(stderr, "interrupted at step %lld: the same command goes on from there\n",
                 static_cast<long long>(summary.step));
    return 4;
  }
  std::printf("%s: %s after %lld steps\n", (arguments.out / file).c_str(), summary.why.c_str(),
              static_cast<long long>(summary.step));
  return 0;
}

}  // namespace

int main(int count, char** words) {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {  // else a file gets the number of one that is closed
    if (::fcntl(stream, F_GETFD) < 0) (void)!::open("/dev/null", O_RDWR);
  }
  if (nn::TellOpenBlasTheProcessor()) ::execv("/proc/self/exe", words);  // it was loaded already; without, slower
  const std::vector<std::string> given(words + 1, words + count);
  if (given.size() == 1 && (given[0] == "--help" || given[0] == "-h")) {
    std::fputs(kUsage, stdout);
    return 0;
  }
  try {
    return Train(Read(given));
  } catch (const evac::TensorWriteError& error) {
    std::fprintf(stderr, "evac-train: %s\n", error.what());
    return 4;
  } catch (const evac::TensorError& error) {
    std::fprintf(stderr, "evac-train: %s\n", error.what());
    return 2;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "evac-train: %s\n", error.what());
    return 4;
  }
}
