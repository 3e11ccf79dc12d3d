#include <fmt/format.h>

#include <cstdint>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "apps/commands.h"
#include "core/error.h"
#include "reports/plan.h"

namespace evac {
namespace {

constexpr std::int64_t kMostTrials = 100'000;  // the power of each is a sum over as many flips

struct PlanArguments {
  PlanOptions options;
  bool json = false;
};

}  // namespace

void AddPlan(CLI::App& app, ExitCode& exit_code) {
  const auto arguments = std::make_shared<PlanArguments>();
  PlanOptions& o = arguments->options;
  CLI::App* command = app.add_subcommand("plan", "Say how many episodes, raters and real trials a question takes.");
  command->add_option("--rate", o.rate, "success rate expected")->capture_default_str();
  command->add_option("--difference", o.difference, "between two policies, that must not be missed")
      ->capture_default_str();
  command->add_option_function<double>(
      "--flips", [arguments](const double& share) { arguments->options.flips = share; },
      "share of initial states in which the two differ (default: 0.2, as far as the two rates allow it)");
  command->add_option("--trials", o.trials, "initial states at hand")->capture_default_str();
  command->add_option("--margin", o.margin, "of \"not worse by\"")->capture_default_str();
  command->add_option("--correlation", o.correlation, "over policies, to be shown")->capture_default_str();
  command->add_option("--accuracy", o.accuracy, "how often one rater is right")->capture_default_str();
  command->add_option("--right", o.wanted_right, "how often the raters' majority shall be")->capture_default_str();
  command->add_option("--imagined", o.imagined, "imagined trials beside the real ones")->capture_default_str();
  command->add_option("--agreement", o.agreement, "how often model and robot have one outcome")->capture_default_str();
  command->add_option("--alpha", o.promise.alpha, "risk of a false alarm, two-sided")->capture_default_str();
  command->add_option("--power", o.promise.power, "chance to see what is there")->capture_default_str();
  command->add_flag("--json", arguments->json, "for programs: docs/plan.md");
  command->footer(
      "Examples:\n"
      "  evac plan\n"
      "  evac plan --rate 0.28 --difference 0.08 --trials 25\n"
      "  evac plan --rate 0.85 --flips 0.15 --trials 100 --imagined 2000 --json");
  command->callback([arguments, &exit_code] {
    const std::int64_t trials = arguments->options.trials;
    if (trials > kMostTrials) throw InvalidInput("plan: --trials is {}, wanted at most {}", trials, kMostTrials);
    const Plan plan = MakePlan(arguments->options);
    arguments->json ? fmt::print("{}\n", PlanJson(plan).dump(2)) : fmt::print("{}", PlanText(plan));
    exit_code = ExitCode::kOk;
  });
}

}  // namespace evac
