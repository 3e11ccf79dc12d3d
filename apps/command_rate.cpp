#include "apps/command_rate.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <thread>

#include "apps/interrupts.h"
#include "apps/network_parts.h"
#include "apps/number_range.h"
#include "apps/progress_display.h"
#include "apps/rate_resolve.h"
#include "apps/rate_status.h"
#include "apps/rate_tables.h"
#include "core/file.h"
#include "core/secret.h"
#include "core/store.h"
#include "core/version.h"
#include "judges/rating_server.h"
#include "judges/rating_study.h"

namespace evac {
namespace {

constexpr const char* kProgram = "evac " EVAC_VERSION;
constexpr int kPort = 8766;

std::int64_t Now_ms() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

struct RateArguments {
  std::string study, file, role = "rater", url, csv, jsonl;
  std::string round_trip, config;
  std::optional<int> raters;  ///< nothing: nobody asked for so many
  int count = 1;
  bool as_json = false;
  StudyOptions make{};
  RatingServerOptions serve{};
  ResolveOptions resolve{};
};

/// Gold is chosen once: of a name that nobody has, a study would be frozen without any.
void DemandKnownGold(const StudyOptions& options) {
  if (options.gold_from.empty()) return;
  std::set<std::string> judges;
  for (const std::filesystem::path& run : options.runs) {
    for (const std::string& judge : Store::Open(run, Store::Mode::kReadOnly).Judges()) judges.insert(judge);
  }
  if (judges.contains(options.gold_from)) return;
  throw InvalidInput("--gold-from: found '{}', wanted one who has judged these runs: {}", options.gold_from,
                     judges.empty() ? "nobody has yet" : fmt::format("{}", fmt::join(judges, ", ")));
}

/// What a study was begun with holds for its later waves: raters know how many they are, and their orders stand.
void KeepWhatTheStudyBeganWith(const RateArguments& arguments, StudyOptions& options) {
  options.raters_per_clip = arguments.raters.value_or(options.raters_per_clip);
  if (!StudyStore::IsIn(arguments.study)) return;
  const StudyInfo began = StudyStore::Open(arguments.study, StudyStore::Mode::kReadOnly).info();
  if (arguments.raters.value_or(began.raters_per_clip) != began.raters_per_clip)
    throw InvalidInput("--raters: found {}, but {} was begun with {}, and a wave cannot change that", *arguments.raters,
                       arguments.study, began.raters_per_clip);
  if (!options.name.empty() && options.name != began.name)
    throw InvalidInput("--name: found '{}', but {} was begun as '{}', and a wave cannot change that", options.name,
                       arguments.study, began.name);
  options.raters_per_clip = began.raters_per_clip;
}

void New(RateArguments& arguments) {
  StudyOptions options = arguments.make;
  KeepWhatTheStudyBeganWith(arguments, options);
  DemandKnownGold(options);
  if (arguments.round_trip.empty() != arguments.config.empty())
    throw InvalidInput("--vae-roundtrip WEIGHTS and --config PAGE go together: found one of the two");
  if (!arguments.round_trip.empty()) {
    NeedNetworks();
    options.round_trip = CodecRoundTrip(arguments.round_trip, arguments.config);
  }
  options.evac_version = kProgram;
  CountDisplay display("clips", stderr);
  const StudyMade made =
      MakeStudy(arguments.study, options, [&](std::size_t done, std::size_t of) { display.Show(done, of); });
  fmt::print("{}: {} clips to rate, {} gold, {} practice, {} examples; list {}\n", arguments.study, made.clips,
             made.gold, made.practice, made.examples, made.list_hash.substr(0, 12));
  for (const std::string& sentence : made.left_out) fmt::print("left out: {}\n", sentence);
  for (const std::string& warning : made.warnings) fmt::print("note: {}\n", warning);
  if (options.gold_from.empty())
    fmt::print("no gold and no practice: --gold-from JUDGE takes them from a judge that is known to be right\n");
  fmt::print("next:\n  evac rate invite {0} --count {1}\n  evac rate serve {0}\n", arguments.study,
             options.raters_per_clip);
}

void Invite(const RateArguments& arguments) {
  StudyStore store = StudyStore::Open(arguments.study, StudyStore::Mode::kReadWrite);
  const RaterRole role = RaterRoleFromName(arguments.role);
  const std::string url = arguments.url.empty() ? fmt::format("http://127.0.0.1:{}", kPort) : PublicUrl(arguments.url);
  store.Begin();
  std::vector<std::string> secrets;
  for (int i = 0; i < arguments.count; ++i) {
    secrets.push_back(NewSecret());
    store.AddInvite(secrets.back(), role, Now_ms());
  }
  store.Commit();
  for (const std::string& secret : secrets) fmt::print("{}/r/{}\n", url, secret);
}

/// Until somebody interrupts.
void Serve(RateArguments& arguments) {
  arguments.serve.study = arguments.study;
  arguments.serve.desk.app_version = kProgram;
  RatingServer server(arguments.serve);
  const CatchInterrupts interrupts;
  std::thread thread([&server] { server.Serve(); });
  fmt::print("{}\nno TLS here: to other machines only through a reverse proxy (docs/rating_session.md)\n",
             server.url());
  std::fflush(stdout);
  while (!IsInterrupted()) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  server.Stop();
  thread.join();
}

void Export(const RateArguments& arguments) {
  if (arguments.csv.empty() == arguments.jsonl.empty()) throw InvalidInput("wanted either --csv FILE or --jsonl FILE");
  const std::string& file = arguments.csv.empty() ? arguments.jsonl : arguments.csv;
  if (file != "-") RefuseFolder(file);
  const StudyTable table = StudyStore::Open(arguments.study, StudyStore::Mode::kReadOnly).VerdictTable();
  const std::string text = arguments.csv.empty() ? RatingJsonLines(table) : RatingCsv(table);
  if (file == "-") {
    std::fwrite(text.data(), 1, text.size(), stdout);
    return;
  }
  MakeFolders(std::filesystem::path(file).parent_path());
  WriteFileAtomically(file, text);
  fmt::print("{}: {} verdicts\n", file, table.rows.size());
}

void Import(const RateArguments& arguments) {
  StudyStore store = StudyStore::Open(arguments.study, StudyStore::Mode::kReadWrite);
  const std::vector<StudyClip> clips = store.Clips();
  const auto verdicts = ReadRatingCsv(ReadFile(arguments.file), arguments.file, clips);
  const int added = ImportVerdicts(store, verdicts, arguments.file, Now_ms(), kProgram);
  fmt::print("{}: {} verdicts, {} new\n", arguments.file, verdicts.size(), added);
  const std::int64_t uncounted = UncountedIn(verdicts, clips);
  if (uncounted > 0) fmt::print("note: {} of them are of examples and practice clips: no rate counts them\n", uncounted);
}

void Resolve(const RateArguments& arguments) {
  const StudyStore study = StudyStore::Open(arguments.study, StudyStore::Mode::kReadOnly);
  const Resolved resolved = ResolveStudy(study, arguments.resolve);
  fmt::print("{}: {} clips decided, {} not; {} new verdicts in their runs\n", arguments.resolve.judge, resolved.decided,
             resolved.undecided, resolved.written);
  if (resolved.unlabelled > 0)
    fmt::print("note: {} of the study's clips are examples and practice: they get no label, and no rate counts them\n",
               resolved.unlabelled);
  for (const std::string& warning : resolved.warnings) fmt::print("note: {}\n", warning);
}

CLI::App* Sub(CLI::App& rate, const std::shared_ptr<RateArguments>& arguments, ExitCode& exit_code, const char* name,
              const char* what, void (*act)(RateArguments&)) {
  CLI::App* command = rate.add_subcommand(name, what);
  command->add_option("STUDY", arguments->study, "the study's folder")->required();
  command->callback([arguments, &exit_code, act] {
    act(*arguments);
    exit_code = ExitCode::kOk;
  });
  return command;
}

void AddNew(CLI::App& rate, const std::shared_ptr<RateArguments>& shared, ExitCode& exit_code) {
  RateArguments& a = *shared;
  CLI::App* command =
      Sub(rate, shared, exit_code, "new", "Freeze the clips of runs into a study, or add a wave to one", New);
  command->add_option("--run", a.make.runs, "folder of a run, repeatable; real and other worlds side by side")
      ->required()
      ->allow_extra_args(false);
  command->add_option("--raters", a.raters, "votes per clip; of a study that is there, as many as it began with")
      ->default_str(std::to_string(a.make.raters_per_clip));
  command->add_option("--seed", a.make.seed, "of every rater's order")->capture_default_str();
  command->add_option("--name", a.make.name, "of the study; else its folder's");
  command->add_option("--states", a.make.states, "so many initial states per task, drawn by the seed; 0: all")
      ->capture_default_str();
  command
      ->add_option("--height", a.make.height_px,
                   "of the first view as raters see it, pixels; of a study that is there, what it began with")
      ->default_str(std::to_string(kStudyHeight_px));
  command->add_option("--vae-roundtrip", a.round_trip,
                      "weights of a world model: clips that it did not imagine are shown as its codec gives them back");
  command->add_option("--config", a.config, "that world model's page");
  command->add_option("--gold-from", a.make.gold_from,
                      "a judge whose verdicts are known to be right: examples, practice and gold clips");
}

void AddServe(CLI::App& rate, const std::shared_ptr<RateArguments>& shared, ExitCode& exit_code) {
  RateArguments& a = *shared;
  CLI::App* command = Sub(rate, shared, exit_code, "serve", "Let raters in", Serve);
  a.serve.port = kPort;
  command->add_option("--host", a.serve.host, "address to listen at; another than 127.0.0.1 is open to the network")
      ->capture_default_str();
  command->add_option("--port", a.serve.port, "0: any that is free")
      ->check(CLI::Range(0, 65535))
      ->capture_default_str();
  command->add_option("--url", a.serve.public_url, "of the reverse proxy in front of it: https://rate.lab.org");
  command->add_option("--cover", a.serve.desk.cover_share, "share of a clip that must be watched before its verdict")
      ->check(Within(0.0, 1.0))
      ->capture_default_str();
}

}  // namespace

void AddRate(CLI::App& app, ExitCode& exit_code) {
  const auto shared = std::make_shared<RateArguments>();
  RateArguments& a = *shared;
  CLI::App* rate = app.add_subcommand("rate", "Let people rate clips, blind, and keep every vote");
  rate->require_subcommand(1);
  rate->footer(
      "Example:\n  evac rate new out/study --run out/demo --gold-from oracle\n  evac rate invite out/study --count 3\n"
      "  evac rate serve out/study\n  evac rate resolve out/study\ndocs/rating_session.md.");
  AddNew(*rate, shared, exit_code);
  CLI::App* invite =
      Sub(*rate, shared, exit_code, "invite", "Print links, each for one person", [](RateArguments& b) { Invite(b); });
  invite->add_option("--role", a.role, "rater, adjudicator or lead")->capture_default_str();
  invite->add_option("--count", a.count, "how many")->check(CLI::Range(1, 1000))->capture_default_str();
  invite->add_option("--url", a.url, "what links begin with; else the loopback address of `evac rate serve`");
  AddServe(*rate, shared, exit_code);
  CLI::App* status =
      Sub(*rate, shared, exit_code, "status", "How far a study is, and how raters agree", [](RateArguments& b) {
        PrintRatingStatus(StudyStore::Open(b.study, StudyStore::Mode::kReadOnly), Now_ms(), b.as_json);
      });
  status->add_flag("--json", a.as_json, "all that the lead's board shows");
  CLI::App* exporting =
      Sub(*rate, shared, exit_code, "export", "Every verdict with every field", [](RateArguments& b) { Export(b); });
  exporting->add_option("--csv", a.csv, "file to write; -: standard output");
  exporting->add_option("--jsonl", a.jsonl, "the same as JSON lines");
  CLI::App* importing = Sub(*rate, shared, exit_code, "import", "Verdicts of a sheet: columns episode, rater, label",
                            [](RateArguments& b) { Import(b); });
  importing->add_option("FILE", a.file, "CSV")->required();
  CLI::App* resolve = Sub(*rate, shared, exit_code, "resolve", "Write the decided labels into the runs",
                          [](RateArguments& b) { Resolve(b); });
  resolve->add_option("--as", a.resolve.judge, "the judge's name there")->capture_default_str();
  resolve->add_flag("--each-rater", a.resolve.each_rater, "every rater's votes as well, as human:STUDY:rN");
  resolve->add_flag("--mix-rubrics", a.resolve.mix_rubrics, "labels by different rubrics of one task together");
}

}  // namespace evac
