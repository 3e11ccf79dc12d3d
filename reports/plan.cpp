#include "reports/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/error.h"
#include "core/statistics/association.h"
#include "core/statistics/ppi.h"
#include "core/statistics/rates.h"
#include "reports/estimate_json.h"
#include "reports/text_table.h"
#include "reports/wording.h"

namespace evac {
namespace {

void Require(bool holds, const char* option, double found, const char* wanted) {
  if (!holds) throw InvalidInput("plan: --{} is {}, wanted {}", option, found, wanted);
}

constexpr double kUsualFlips = 0.2, kRounding = 1e-9;

/// The other policy's rate: towards the side with room.
double OtherRate(const PlanOptions& o) {
  const double above = o.rate + o.difference, below = o.rate - o.difference;
  if (above <= 1 + kRounding) return std::min(1.0, above);
  return std::abs(below) < kRounding ? 0 : below;
}

/// In how many states two such policies can differ: beside the difference, as often either way as the worse succeeds
/// and the better fails.
double MostFlips(const PlanOptions& o) {
  const auto [worse, better] = std::minmax({o.rate, OtherRate(o)});
  return o.difference + 2 * std::min(worse, 1 - better);
}

void CheckFlips(const PlanOptions& o) {
  if (!o.flips) return;
  const double flips = *o.flips, most = MostFlips(o);
  Require(flips > 0 && flips <= 1, "flips", flips, "above 0 and at most 1");
  Require(flips >= o.difference, "flips", flips, "at least the difference: without flips there is none");
  const std::string wanted = fmt::format("at most {:.4g}: of {} against {} no more can differ", most,
                                         GivenPercent(OtherRate(o)), GivenPercent(o.rate));
  Require(flips <= most + kRounding, "flips", flips, wanted.c_str());
}

void Check(const PlanOptions& o) {
  const auto inside = [](double x) { return x > 0 && x < 1; };
  Require(inside(o.rate), "rate", o.rate, "between 0 and 1");
  Require(inside(o.difference), "difference", o.difference, "between 0 and 1");
  const std::string room =
      fmt::format("at most {:.4g}, as far as a rate can be from {:g}", std::max(o.rate, 1 - o.rate), o.rate);
  Require(OtherRate(o) >= 0, "difference", o.difference, room.c_str());
  CheckFlips(o);
  Require(o.trials >= 1, "trials", static_cast<double>(o.trials), "at least 1");
  Require(inside(o.margin), "margin", o.margin, "between 0 and 1");
  Require(inside(o.correlation), "correlation", o.correlation, "between 0 and 1");
  Require(o.accuracy > 0.5 && o.accuracy <= 1, "accuracy", o.accuracy, "above 0.5 and at most 1");
  Require(inside(o.wanted_right), "right", o.wanted_right, "between 0 and 1");
  Require(o.imagined >= 0, "imagined", static_cast<double>(o.imagined), "at least 0");
  Require(o.agreement >= 0 && o.agreement <= 1, "agreement", o.agreement, "between 0 and 1");
  Require(inside(o.promise.alpha), "alpha", o.promise.alpha, "between 0 and 1");
  Require(inside(o.promise.power), "power", o.promise.power, "between 0 and 1");
}

/// Of what came out; what was asked for is said as it was given (GivenPoints, GivenPercent).
std::string InPoints(double share) { return fmt::format("{:.0f} points", 100 * share); }

/// "0.90", "0.999".
std::string GivenNumber(double value) {
  const std::string text = fmt::format("{:.2f}", value);
  return std::stod(text) == value ? text : fmt::format("{:g}", value);
}

PlanRow Row(std::string key, std::string question, const Number& value, std::string shown, std::string method) {
  return {std::move(key), std::move(question), value, value ? std::move(shown) : "undefined: " + value.reason(),
          std::move(method)};
}

PlanRow SizeRow(std::string key, std::string question, const SampleSize& size, std::string method) {
  const Number value = size.exact ? Number(static_cast<double>(size.n)) : size.exact;
  return Row(std::move(key), std::move(question), value, std::to_string(size.n), std::move(method));
}

double Confidence(const PlanOptions& options) { return 1 - options.promise.alpha; }

FlipRates FlipsOf(const PlanOptions& o) {
  return {(*o.flips + o.difference) / 2, std::max(0.0, *o.flips - o.difference) / 2};
}

void AddRates(const PlanOptions& o, std::vector<PlanRow>& rows) {
  const double half_width = WilsonHalfWidth(o.rate, o.trials, Confidence(o));
  rows.push_back(Row("interval_half_width",
                     fmt::format("interval of a rate of {} from {}", GivenPercent(o.rate), Counted(o.trials, "episode")),
                     half_width, "± " + InPoints(half_width), "Wilson"));
  for (const double wanted : {0.1, 0.05}) {
    const std::int64_t n = TrialsForHalfWidth(o.rate, wanted, Confidence(o));
    rows.push_back(Row(fmt::format("episodes_for_{:.0f}_points", 100 * wanted),
                       fmt::format("episodes for ± {} at that rate", GivenPoints(wanted)), static_cast<double>(n),
                       std::to_string(n), "Wilson"));
  }
}

void AddDifferences(const PlanOptions& o, std::vector<PlanRow>& rows) {
  const std::string seen = fmt::format("to see {} against {}", GivenPercent(OtherRate(o)), GivenPercent(o.rate));
  const FlipRates flips = FlipsOf(o);
  rows.push_back(SizeRow("paired_states",
                         fmt::format("initial states {}, same states, {} of them flip", seen, GivenPercent(*o.flips)),
                         PairsForMcNemar(flips, o.promise), "exact McNemar"));
  rows.push_back(SizeRow("unpaired_episodes", fmt::format("episodes of each policy {}, different states", seen),
                         TrialsPerPolicy(o.rate, OtherRate(o), o.promise), "normal approximation"));
  const double power = McNemarPower(o.trials, flips, o.promise.alpha);
  rows.push_back(Row("paired_power", fmt::format("power of {} for that, paired", Counted(o.trials, "state")), power,
                     fmt::format("{:.2f}", power), "exact McNemar"));
  const Number detectable = DetectableDifference(o.rate, o.trials, o.promise);
  rows.push_back(Row("detectable_difference",
                     fmt::format("smallest difference that {}, unpaired",
                                 Counted(o.trials, "episode of each sees", "episodes of each see")),
                     detectable, detectable ? InPoints(*detectable) : "", "normal approximation"));
  rows.push_back(SizeRow("non_inferiority_pairs",
                         fmt::format("initial states to show \"not worse by {}\", paired", GivenPoints(o.margin)),
                         PairsForNonInferiority(*o.flips, o.margin, o.promise), "normal approximation, one-sided"));
  rows.push_back(SizeRow("non_inferiority_episodes", fmt::format("episodes of each policy to show that, unpaired"),
                         TrialsForNonInferiority(o.rate, o.margin, o.promise), "normal approximation, one-sided"));
}

void AddCorrelation(const PlanOptions& o, std::vector<PlanRow>& rows) {
  rows.push_back(SizeRow("correlation_points",
                         fmt::format("policies to show that a correlation of {} is not 0", GivenNumber(o.correlation)),
                         PointsForCorrelation(o.correlation, o.promise), "Fisher z"));
}

void AddRaters(const PlanOptions& o, std::vector<PlanRow>& rows) {
  const int raters = RatersFor(o.accuracy, o.wanted_right);
  const Number value = raters > 0 ? Number(raters) : Number(Undefined{"more than 99"});
  rows.push_back(
      Row("raters",
          fmt::format("raters, each {} right, for a majority {} right", GivenPercent(o.accuracy),
                      GivenPercent(o.wanted_right)),
          value, std::to_string(raters), "binomial"));
  const PanelQuality three = PanelOf(3, o.accuracy);
  rows.push_back(Row("three_raters_right", "three such raters: majority right", three.majority_right,
                     Percent(three.majority_right), "binomial"));
  rows.push_back(Row("three_raters_split", "three such raters: clips on which they differ", three.split,
                     Percent(three.split), "binomial"));
}

/// Widths if the outcomes fall as expected.
void AddReal(const PlanOptions& o, std::vector<PlanRow>& rows) {
  for (const std::int64_t n : {10, 20, 40, 100}) {
    const auto part = [&](double share) {
      return static_cast<std::int64_t>(std::lround(share * static_cast<double>(n)));
    };
    const std::int64_t successes = part(o.rate);  // halves are rounded up, each by itself
    const std::int64_t only_real = std::min(successes, part(o.rate * (1 - o.agreement))),
                       only_model = std::min(n - successes, part((1 - o.rate) * (1 - o.agreement)));
    const BothWorlds table{successes - only_real, only_real, only_model, n - successes - only_model};
    const double model_rate = o.rate * o.agreement + (1 - o.rate) * (1 - o.agreement);
    const Count further{std::llround(model_rate * static_cast<double>(o.imagined)), o.imagined};
    const Estimate alone = WilsonInterval(successes, n, Confidence(o)), both = PpiMover(table, further, Confidence(o));
    const auto half = [](const Estimate& e) { return (e.interval->high - e.interval->low) / 2; };
    const Number value = both.value ? Number(half(both)) : Number(Undefined{both.value.reason()});
    rows.push_back(Row(fmt::format("real_{}_half_width", n),
                       fmt::format("interval of the real rate from {} real trials (alone ± {}) and {} imagined", n,
                                   InPoints(half(alone)), o.imagined),
                       value, value ? "± " + InPoints(*value) : "", "MOVER"));
  }
}

const PlanRow& At(const std::vector<PlanRow>& rows, const std::string& key) {
  return *std::ranges::find(rows, key, &PlanRow::key);
}

std::vector<std::string> Words(const PlanOptions& o, const std::vector<PlanRow>& rows) {
  std::vector<std::string> words;
  const PlanRow &paired = At(rows, "paired_states"), &unpaired = At(rows, "unpaired_episodes");
  if (paired.value && unpaired.value) {
    words.push_back(
        fmt::format("To see a difference of {} with {} power, run both policies on the same {} initial states; on "
                    "different ones it "
                    "takes {} episodes of each.",
                    GivenPoints(o.difference), GivenPercent(o.promise.power), paired.shown, unpaired.shown));
  }
  const double power = *At(rows, "paired_power").value;
  words.push_back(
      fmt::format("The {} it with a chance of {}{}.", Counted(o.trials, "state at hand sees", "states at hand see"),
                  Percent(power),
                  power < 0.5 ? ": less than a coin, so do not read \"no difference\" into such a run" : ""));
  words.push_back(
      fmt::format("One policy's rate comes out as {} {}.", GivenPercent(o.rate), At(rows, "interval_half_width").shown));
  const PlanRow& raters = At(rows, "raters");
  if (raters.value) {
    words.push_back(fmt::format("Use {} per clip; three would differ on {} of the clips, which need a fourth look.",
                                Counted(static_cast<std::int64_t>(*raters.value), "rater"),
                                At(rows, "three_raters_split").shown));
  }
  const PlanRow& points = At(rows, "correlation_points");
  if (points.value) {
    words.push_back(
        fmt::format("To tell a correlation of {} from 0 with {} power takes {} policies; fewer see it less often.",
                    GivenNumber(o.correlation), GivenPercent(o.promise.power), points.shown));
  }
  return words;
}

}  // namespace

Plan MakePlan(const PlanOptions& options) {
  Check(options);
  Plan plan{options, {}, {}};
  const PlanOptions& o = plan.options;
  if (!o.flips) plan.options.flips = std::clamp(kUsualFlips, o.difference, std::max(o.difference, MostFlips(o)));
  AddRates(o, plan.rows);
  AddDifferences(o, plan.rows);
  AddCorrelation(o, plan.rows);
  AddRaters(o, plan.rows);
  AddReal(o, plan.rows);
  plan.words = Words(o, plan.rows);
  return plan;
}

std::string PlanText(const Plan& plan) {
  std::string text;
  for (const std::string& sentence : plan.words) text += sentence + "\n";
  std::vector<std::vector<std::string>> rows{{"QUESTION", "ANSWER", "METHOD"}};
  for (const PlanRow& row : plan.rows) rows.push_back({row.question, row.shown, row.method});
  const Promise& promise = plan.options.promise;
  return text + "\n" + TextTable(rows) +
         fmt::format("Sizes: alpha {} two-sided unless said otherwise, power {}.\n", promise.alpha, promise.power);
}

nlohmann::ordered_json PlanJson(const Plan& plan) {
  const PlanOptions& o = plan.options;
  nlohmann::ordered_json json = {{"schema", 1}};
  json["options"] = {{"rate", o.rate},           {"difference", o.difference}, {"flips", *o.flips},
                     {"trials", o.trials},       {"margin", o.margin},         {"correlation", o.correlation},
                     {"accuracy", o.accuracy},   {"right", o.wanted_right},    {"imagined", o.imagined},
                     {"agreement", o.agreement}, {"alpha", o.promise.alpha},   {"power", o.promise.power}};
  json["words"] = plan.words;
  json["rows"] = nlohmann::ordered_json::array();
  for (const PlanRow& row : plan.rows) {
    nlohmann::ordered_json& entry = json["rows"].emplace_back();
    entry["key"] = row.key;
    entry["question"] = row.question;
    Put(entry, "value", row.value);
    entry["shown"] = row.shown;
    entry["method"] = row.method;
  }
  return json;
}

}  // namespace evac
