#include <fstream>
#include <iterator>

#include "apps/commands.h"
#include "apps/network_parts.h"
#include "apps/program_beside.h"

/// Networks of a program that has none: it becomes the one that has.
namespace evac {
namespace {

/// The command line, without the program's name.
std::vector<std::string> Arguments() {
  std::ifstream file("/proc/self/cmdline", std::ios::binary);
  std::vector<std::string> words;
  for (std::string word; std::getline(file, word, '\0');) words.push_back(word);
  if (words.empty()) throw InternalError("cannot read /proc/self/cmdline");
  words.erase(words.begin());
  return words;
}

[[noreturn]] void BecomeNetworks() { BecomeProgramBeside("evac-networks", Arguments()); }

/// Its options, and its help, are the other program's.
void AddBeside(CLI::App& app, const NetworkCommand& network) {
  CLI::App* command = app.add_subcommand(network.name, network.what);
  command->set_help_flag();
  command->prefix_command();
  command->callback(BecomeNetworks);
}

}  // namespace

void NeedNetworks() { BecomeNetworks(); }

std::unique_ptr<World> MakeEvacWorld(const SuiteWorld&, const Suite&, const Store*) { BecomeNetworks(); }
void CheckNetwork(const SuiteWorld&, const std::vector<Task>&) { BecomeNetworks(); }
Recording ReadAsTrained(const Suite&, const std::filesystem::path&) { BecomeNetworks(); }
ClipRoundTrip CodecRoundTrip(const std::filesystem::path&, const std::filesystem::path&) { BecomeNetworks(); }
std::unique_ptr<Policy> MakeLearnedPolicy(const std::filesystem::path&, int) { BecomeNetworks(); }
std::unique_ptr<Judge> MakeClassifier(const std::filesystem::path&, const Store&) { BecomeNetworks(); }

void AddFidelity(CLI::App& app, ExitCode&) { AddBeside(app, kFidelityCommand); }
void AddWeights(CLI::App& app, ExitCode&) { AddBeside(app, kWeightsCommand); }
void AddImagine(CLI::App& app, ExitCode&) { AddBeside(app, kImagineCommand); }
void AddTrain(CLI::App& app, ExitCode&) { AddBeside(app, kTrainCommand); }
void AddEncode(CLI::App& app, ExitCode&) { AddBeside(app, kEncodeCommand); }
void AddPack(CLI::App& app, ExitCode&) { AddBeside(app, kPackCommand); }
void AddVary(CLI::App& app, ExitCode&) { AddBeside(app, kVaryCommand); }
void AddJudgeTrain(CLI::App& judge, ExitCode&) { AddBeside(judge, kJudgeTrainCommand); }

}  // namespace evac
