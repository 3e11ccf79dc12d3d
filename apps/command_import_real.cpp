#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <tuple>
#include <vector>

#include "apps/commands.h"
#include "core/file.h"
#include "core/hash.h"
#include "core/store.h"
#include "reports/real_trials_csv.h"
#include "reports/wording.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

struct ImportArguments {
  std::string file, run;
  bool new_states = false;
};

KnownNames NamesOf(const Store& store, bool new_states_too) {
  KnownNames known;
  known.new_states_too = new_states_too;
  for (const Task& task : store.Tasks()) known.tasks.insert(task.id);
  for (const PolicyInfo& policy : store.Policies()) known.policies.insert({policy.name, policy.checkpoint});
  for (const Episode& episode : store.Episodes())
    known.states.insert({episode.key.pair.task, episode.key.pair.initial_state});
  return known;
}

/// Two days' trials.csv are two files: each trial is kept with the path of its own, wherever its reader stood.
void KeepPath(const fs::path& file, std::vector<RealTrial>& trials) {
  const std::string path = fs::weakly_canonical(file).string();
  for (RealTrial& trial : trials) trial.source = path + trial.source.substr(trial.source.rfind(':'));
}

/// The trials with their videos where the CSV says they are; complains of the first that is not there.
std::vector<fs::path> VideosOf(const std::vector<RealTrial>& trials, const fs::path& beside) {
  std::vector<fs::path> videos;
  for (const RealTrial& trial : trials) {
    const fs::path path = trial.video.empty() ? fs::path() : beside / trial.video;
    if (!path.empty() && !fs::is_regular_file(path)) {
      throw InvalidInput("{}: column video: found \"{}\", wanted a file (looked for {}); nothing was imported",
                         trial.source, trial.video, path.string());
    }
    videos.push_back(path);
  }
  return videos;
}

/// Copies into RUN/real_videos under the name of its content. @returns the path from RUN.
std::string KeepVideo(const fs::path& video, const fs::path& run) {
  const std::string bytes = ReadFile(video);
  const std::string name = "real_videos/" + Sha256Hex(bytes) + video.extension().string();
  MakeFolders(run / "real_videos");
  if (!fs::exists(run / name)) WriteFileAtomically(run / name, bytes);
  return name;
}

void Import(const ImportArguments& arguments) {
  Store store = Store::Open(arguments.run, Store::Mode::kReadWrite);
  const fs::path file = arguments.file;
  RealTrialsCsv csv =
      ReadRealTrialsCsv(ReadFile(file), file.filename().string(), NamesOf(store, arguments.new_states));
  for (const std::string& warning : csv.warnings) fmt::print(stderr, "evac: warning: {}\n", warning);
  KeepPath(file, csv.trials);
  std::vector<RealTrial> added = NewTrials(csv.trials, store.RealTrials(), csv.counted);
  const std::vector<fs::path> videos = VideosOf(added, file.parent_path());
  std::set<std::tuple<std::string, std::string>> states;
  for (std::size_t i = 0; i < added.size(); ++i) {
    if (!videos[i].empty()) added[i].video = KeepVideo(videos[i], store.folder());
    states.insert({added[i].task, added[i].initial_state});
  }
  store.AddRealTrials(added);
  fmt::print("{} imported, on {}; {} there already. Next: evac trust {}\n",
             Counted(static_cast<std::int64_t>(added.size()), "real trial"),
             Counted(static_cast<std::int64_t>(states.size()), "initial state"), csv.trials.size() - added.size(),
             arguments.run);
}

}  // namespace

void AddImportReal(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<ImportArguments>();
  CLI::App* command = app.add_subcommand("import-real", "Add trials that were made on a real robot to a run.");
  command->add_option("FILE", arguments->file, "CSV: task,initial_state,policy,checkpoint,outcome[,trial][,video]")
      ->required()
      ->type_name("FILE.csv");
  command->add_option("--run", arguments->run, "the run whose tasks, states and policies the file names")
      ->required()
      ->type_name("RUN");
  command->add_flag("--new-states", arguments->new_states, "accept initial states that the run has no episode of");
  command->footer(
      "All rows or none: each wrong line is named. Importing the same file again changes nothing.\n"
      "Examples:\n"
      "  evac import-real trials.csv --run out/demo\n"
      "  evac trust out/demo");
  command->callback([arguments, &exit_code] {
    Import(*arguments);
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
