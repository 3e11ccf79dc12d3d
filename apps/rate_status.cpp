#include "apps/rate_status.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <set>

#include "judges/rating_board.h"
#include "reports/text_table.h"
#include "reports/wording.h"

namespace evac {
namespace {

using Json = nlohmann::ordered_json;

std::string Percent(const Json& number) {
  return number.at("value").is_null() ? "-" : fmt::format("{:.1f} %", 100 * number.at("value").get<double>());
}

std::string Decimal(const Json& number) {
  if (number.at("value").is_null()) return "undefined (" + number.value("reason", "") + ")";
  std::string text = fmt::format("{:.3f}", number.at("value").get<double>());
  if (number.contains("low"))
    text += fmt::format(" [{:.3f}, {:.3f}]", number.at("low").get<double>(), number.at("high").get<double>());
  return text;
}

/// Beside alpha's interval: from how many replicates it is not.
std::string Dropped(const Json& agreement) {
  const auto dropped = agreement.at("dropped_replicates").get<std::int64_t>();
  return dropped > 0 ? fmt::format(" ({} without any spread dropped)", Counted(dropped, "replicate")) : "";
}

/// Each once, however many raters could not play it.
std::size_t UnplayableClips(const Json& board) {
  std::set<std::int64_t> clips;
  for (const Json& one : board.at("unplayable")) clips.insert(one.at("clip").get<std::int64_t>());
  return clips.size();
}

void PrintRaters(const Json& board) {
  std::vector<std::vector<std::string>> rows = {
      {"RATER", "NAME", "ROLE", "STATUS", "VERDICTS", "SUCCESS", "MEDIAN", "KNOWN", "AGAIN"}};
  for (const Json& rater : board.at("raters")) {
    const Json& median_s = rater.at("median_rt_s");
    const int verdicts = rater.at("verdicts").get<int>();
    rows.push_back({rater.at("rater"), rater.at("name"), rater.at("role"), rater.at("status"),
                    std::to_string(verdicts),
                    verdicts == 0 ? "-" : fmt::format("{:.0f} %", 100 * rater.at("success_share").get<double>()),
                    median_s.is_null() ? "-" : fmt::format("{:.1f} s", median_s.get<double>()),
                    fmt::format("{}/{}", rater.at("gold_right").get<int>(), rater.at("gold_seen").get<int>()),
                    fmt::format("{}/{}", rater.at("repeats_same").get<int>(), rater.at("repeats_seen").get<int>())});
  }
  fmt::print("{}", TextTable(rows));
  for (const Json& rater : board.at("raters")) {
    for (const Json& concern : rater.at("concerns"))
      fmt::print("look at {}: {}\n", rater.at("rater").get<std::string>(), concern.get<std::string>());
  }
}

}  // namespace

void PrintRatingStatus(const StudyStore& store, std::int64_t now_ms, bool as_json) {
  const Json board = RatingBoard(store, now_ms);
  if (as_json) return fmt::print("{}\n", board.dump(1, ' ', false, Json::error_handler_t::replace));
  const Json& progress = board.at("progress");
  fmt::print("{}: {} of {} clips have {} votes; {} votes, {} missing; {} disputes, {} unplayable\n",
             board.at("study").get<std::string>(), progress.at("complete").get<int>(), progress.at("clips").get<int>(),
             board.at("raters_per_clip").get<int>(), progress.at("votes").get<int>(), progress.at("missing").get<int>(),
             board.at("disputes").size(), UnplayableClips(board));
  const Json& all = board.at("all");
  fmt::print("success: majority {} of {} decided clips; soft {}, unanimous {}, Dawid-Skene {}; undecided {}: {} … {}\n",
             Percent(all.at("majority")), all.at("decided").get<int>(), Percent(all.at("soft")),
             Percent(all.at("unanimous")), Percent(all.at("dawid_skene")), all.at("undecided").get<int>(),
             Percent(all.at("low")), Percent(all.at("high")));
  const Json& agreement = board.at("agreement");
  fmt::print("agreement, \"cannot tell\" a third answer: alpha {}{}, Fleiss kappa {}, raw {}\n",
             Decimal(agreement.at("alpha")), Dropped(agreement), Decimal(agreement.at("fleiss")),
             Percent(agreement.at("agreement")));
  for (const char* world : {"real", "generated"}) {
    const Json& index = board.at("blinding").at(world);
    if (index.at("guesses").get<int>() == 0) continue;
    fmt::print("blinding, {} clips: index {} of {} guesses{}\n", world, Decimal(index.at("index")),
               index.at("guesses").get<int>(),
               index.at("is_seen_through").get<bool>() ? ": raters see what is generated" : "");
  }
  if (board.at("raters_excluded").get<int>() > 0)
    fmt::print("{} raters excluded\n", board.at("raters_excluded").get<int>());
  PrintRaters(board);
}

}  // namespace evac
