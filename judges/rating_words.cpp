#include "judges/rating_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "core/secret.h"
#include "judges/json_text.h"

namespace evac {
namespace {

using nlohmann::json;

constexpr double kLongest_ms = 10 * 365 * 24 * 3600e3;  // ten years: pages stay open for weeks, and lose no verdict
constexpr std::size_t kMostIntervals = 1000, kLongestNote = 2000, kLongestName = 80;

/// Tabs and ends of lines are text: a note that was pasted has them.
bool IsControl(char c) { return static_cast<unsigned char>(c) < 0x20 && c != '\t' && c != '\n' && c != '\r'; }

/// Reads fields of one JSON object and remembers the first thing that is wrong.
class Fields {
 public:
  explicit Fields(std::string_view text) : json_(ParseJson(text)) {
    if (!json_ || !json_->is_object()) Complain("the body is no JSON object");
  }

  const std::string& problem() const { return problem_; }

  std::string Text(const char* name, std::size_t longest, bool must = true) {
    const json* value = Find(name, must);
    if (!value) return "";
    if (!value->is_string()) return Complain("{}: wanted a text", name), "";
    std::string text = value->get<std::string>();
    if (text.size() > longest) return Complain("{}: {} bytes, wanted at most {}", name, text.size(), longest), "";
    if (std::ranges::any_of(text, IsControl)) return Complain("{}: has control characters", name), "";
    return text;
  }

  std::string Secret(const char* name) {
    std::string text = Text(name, 32);
    if (problem_.empty() && !IsSecret(text)) Complain("{}: wanted 32 digits 0-9 a-f", name);
    return text;
  }

  std::string OneOf(const char* name, const std::vector<std::string>& names, bool must = true) {
    std::string text = Text(name, 64, must);
    if (problem_.empty() && (must || !text.empty()) && std::ranges::find(names, text) == names.end())
      Complain("{}: found '{}', wanted {}", name, Excerpt(text), fmt::join(names, ", "));
    return text;
  }

  double Real(const char* name, double least, double most, bool must = false) {
    const json* value = Find(name, must);
    if (!value) return least;
    const double number = value->is_number() ? value->get<double>() : std::nan("");
    if (!(number >= least && number <= most)) return Complain("{}: wanted {} … {}", name, least, most), least;
    return number;
  }

  std::int64_t Integer(const char* name, std::int64_t least, std::int64_t most, bool must = false) {
    const json* value = Find(name, must);
    if (!value) return least;
    const bool fits =
        value->is_number_integer() && !(value->is_number_unsigned() && value->get<std::uint64_t>() > INT64_MAX);
    const std::int64_t number = fits ? value->get<std::int64_t>() : least - 1;
    if (number < least || number > most) return Complain("{}: wanted a whole number {} … {}", name, least, most), least;
    return number;
  }

  bool Flag(const char* name) {
    const json* value = Find(name, false);
    if (value && !value->is_boolean()) Complain("{}: wanted true or false", name);
    return value && value->is_boolean() && value->get<bool>();
  }

  const json* Array(const char* name, std::size_t most) {
    const json* value = Find(name, false);
    if (!value) return nullptr;
    if (!value->is_array() || value->size() > most)
      return Complain("{}: wanted a list of at most {}", name, most), nullptr;
    return value;
  }

  bool Has(const char* name) const {
    return json_ && json_->is_object() && json_->contains(name) && !(*json_)[name].is_null();
  }

  template <typename... Args>
  void Complain(fmt::format_string<Args...> format, Args&&... args) {
    if (problem_.empty()) problem_ = fmt::format(format, std::forward<Args>(args)...);
  }

 private:
  const json* Find(const char* name, bool must) {
    if (!problem_.empty()) return nullptr;
    if (Has(name)) return &(*json_)[name];
    if (must) Complain("{}: is missing", name);
    return nullptr;
  }

  std::optional<json> json_;
  std::string problem_;
};

template <typename T>
Parsed<T> Result(const Fields& fields, T value) {
  if (!fields.problem().empty()) return {std::nullopt, fields.problem()};
  return {std::move(value), ""};
}

bool IsUuid(std::string_view text) {
  return text.size() >= 16 && text.size() <= 64 && std::ranges::all_of(text, [](char c) {
           return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '-';
         });
}

std::string Uuid(Fields& fields, const char* name) {
  std::string text = fields.Text(name, 64);
  if (fields.problem().empty() && !IsUuid(text)) fields.Complain("{}: wanted 16 to 64 letters and digits", name);
  return text;
}

std::string PlayedOf(Fields& fields) {
  const json* played = fields.Array("played", kMostIntervals);
  if (!played) return "[]";
  for (const json& interval : *played) {
    const bool is_pair =
        interval.is_array() && interval.size() == 2 && interval[0].is_number() && interval[1].is_number();
    if (!is_pair || !(interval[0].get<double>() >= 0 && interval[0].get<double>() <= interval[1].get<double>() &&
                      interval[1].get<double>() < 1e6)) {
      fields.Complain("played: wanted pairs of seconds, the first not after the second");
      return "[]";
    }
  }
  return played->dump();
}

std::string FlagsOf(Fields& fields) {
  const json* flags = fields.Array("flags", RatingFlags().size());
  std::string text;
  if (!flags) return text;
  for (const json& flag : *flags) {
    const bool is_known =
        flag.is_string() && std::ranges::find(RatingFlags(), flag.get<std::string>()) != RatingFlags().end();
    if (!is_known) {
      fields.Complain("flags: wanted {}", fmt::join(RatingFlags(), ", "));
      return text;
    }
    text += (text.empty() ? "" : " ") + flag.get<std::string>();
  }
  return text;
}

/// How the clip was watched.
void ReadWatching(Fields& fields, HumanVerdict& verdict) {
  for (const auto& [name, field] :
       {std::pair{"shown_at_ms", &HumanVerdict::shown_at_ms}, std::pair{"first_play_ms", &HumanVerdict::first_play_ms},
        std::pair{"decided_ms", &HumanVerdict::decided_ms}, std::pair{"rt_ms", &HumanVerdict::rt_ms},
        std::pair{"visible_ms", &HumanVerdict::visible_ms}, std::pair{"stalls_ms", &HumanVerdict::stalls_ms}})
    verdict.*field = fields.Real(name, 0, kLongest_ms);
  verdict.played = PlayedOf(fields);
  verdict.coverage = fields.Real("coverage", 0, 1);
  verdict.max_speed = fields.Real("max_speed", 0, 16);
  verdict.median_speed = fields.Real("median_speed", 0, 16);
  for (const auto& [name, field] :
       {std::pair{"seeks", &HumanVerdict::seeks}, std::pair{"replays", &HumanVerdict::replays},
        std::pair{"pauses", &HumanVerdict::pauses}})
    verdict.*field = static_cast<int>(fields.Integer(name, 0, 1'000'000));
  verdict.interrupted = fields.Flag("interrupted");
  verdict.viewport = fields.Text("viewport", 16, false);
  verdict.pixel_ratio = fields.Real("pixel_ratio", 0, 100);
}

std::optional<std::uint64_t> WholeNumber(std::string_view digits) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
  if (digits.empty() || error != std::errc() || end != digits.data() + digits.size()) return std::nullopt;
  return value;
}

/// "bytes=5-9", "bytes=5-", "bytes=-4": of the two numbers one may be missing.
struct BytesAsked {
  std::optional<std::uint64_t> first{}, last{};
};
std::optional<BytesAsked> BytesOf(std::string_view header) {
  constexpr std::string_view kUnit = "bytes=";
  if (!header.starts_with(kUnit)) return std::nullopt;
  header.remove_prefix(kUnit.size());
  const std::size_t dash = header.find('-');
  if (dash == std::string_view::npos) return std::nullopt;
  const std::string_view first_text = header.substr(0, dash), last_text = header.substr(dash + 1);
  const BytesAsked asked{WholeNumber(first_text), WholeNumber(last_text)};
  const bool is_odd = (!asked.first && !first_text.empty()) || (!asked.last && !last_text.empty());
  if (is_odd || (!asked.first && !asked.last)) return std::nullopt;
  if (asked.first && asked.last && *asked.last < *asked.first) return std::nullopt;
  return asked;
}

}  // namespace

const std::vector<std::string>& RatingFlags() {
  static const std::vector<std::string> flags = {"object_teleports", "object_disappears", "robot_deforms",
                                                 "blur_hides",       "ends_early",        "wrong_object"};
  return flags;
}

const std::vector<std::string>& FailureCauses() {
  static const std::vector<std::string> causes = {"missed",    "slipped",      "wrong_object", "wrong_place",
                                                  "collision", "nothing_done", "other"};
  return causes;
}

Parsed<JoinBody> ParseJoin(std::string_view text) {
  Fields fields(text);
  JoinBody body{fields.Secret("invite"), Uuid(fields, "uuid"), fields.Text("name", kLongestName, false)};
  return Result(fields, std::move(body));
}

Parsed<NextBody> ParseNext(std::string_view text) {
  Fields fields(text);
  NextBody body{fields.Integer("tab_epoch", 0, INT64_MAX - 1, true), {}};
  if (const json* held = fields.Array("held", 8)) {
    for (const json& id : *held) {
      if (!id.is_string() || !IsSecret(id.get<std::string>()))
        fields.Complain("held: wanted ids of presentations");
      else
        body.held.push_back(id.get<std::string>());
    }
  }
  return Result(fields, std::move(body));
}

Parsed<HumanVerdict> ParseVerdict(std::string_view text) {
  Fields fields(text);
  HumanVerdict verdict;
  verdict.client_uuid = Uuid(fields, "client_uuid");
  verdict.presentation = fields.Secret("presentation");
  verdict.tab_epoch = fields.Integer("tab_epoch", 0, INT64_MAX - 1, true);
  verdict.label = fields.OneOf("label", {"success", "failure", "cannot_tell"});
  if (fields.Has("supersedes")) verdict.supersedes = fields.Integer("supersedes", 1, INT64_MAX - 1);
  verdict.stages = static_cast<int>(fields.Integer("stages", 0, (1 << kMostStages) - 1));
  if (fields.Has("progress")) verdict.progress = fields.Real("progress", 0, 1);
  verdict.flags = FlagsOf(fields);
  verdict.cause = fields.OneOf("cause", FailureCauses(), false);
  verdict.note = fields.Text("note", kLongestNote, false);
  if (fields.Has("confidence")) verdict.confidence = static_cast<int>(fields.Integer("confidence", 1, 3));
  verdict.is_final = fields.Flag("is_final");
  ReadWatching(fields, verdict);
  return Result(fields, std::move(verdict));
}

Parsed<RetractBody> ParseRetract(std::string_view text) {
  Fields fields(text);
  RetractBody body{fields.Integer("tab_epoch", 0, INT64_MAX - 1, true), Uuid(fields, "client_uuid"),
                   Uuid(fields, "of_uuid")};
  return Result(fields, std::move(body));
}

Parsed<PresentationBody> ParsePresentation(std::string_view text) {
  Fields fields(text);
  PresentationBody body{fields.Integer("tab_epoch", 0, INT64_MAX - 1, true), fields.Secret("presentation"),
                        fields.Text("reason", 200, false)};
  return Result(fields, std::move(body));
}

Parsed<WithdrawBody> ParseWithdraw(std::string_view text) {
  Fields fields(text);
  WithdrawBody body{fields.OneOf("verdicts", {"keep", "exclude"}) == "keep", fields.Flag("erase")};
  return Result(fields, body);
}

Parsed<GuessBody> ParseGuess(std::string_view text) {
  Fields fields(text);
  GuessBody body{fields.Secret("presentation"), fields.OneOf("guess", {"real", "generated", "unsure"})};
  return Result(fields, std::move(body));
}

std::optional<std::size_t> ParseFrom(std::string_view query) {
  constexpr std::string_view kName = "from=";
  if (query.empty()) return 0;
  return query.starts_with(kName) ? WholeNumber(query.substr(kName.size())) : std::nullopt;
}

bool IsOneRange(std::string_view header) { return BytesOf(header).has_value(); }

std::optional<ByteRange> ParseRange(std::string_view header, std::uint64_t size) {
  const auto asked = BytesOf(header);
  if (!asked) return std::nullopt;
  const auto& [first, last] = *asked;
  if (!first) {
    const std::uint64_t count = std::min(*last, size);
    return count == 0 ? std::nullopt : std::optional(ByteRange{size - count, count});
  }
  if (*first >= size) return std::nullopt;
  return ByteRange{*first, std::min(last.value_or(size - 1), size - 1) - *first + 1};
}

std::string_view CookieOf(std::string_view header, std::string_view name) {
  while (!header.empty()) {
    const std::size_t end = header.find(';');
    std::string_view pair = header.substr(0, end);
    while (pair.starts_with(' ')) pair.remove_prefix(1);
    if (pair.starts_with(name) && pair.size() > name.size() && pair[name.size()] == '=')
      return pair.substr(name.size() + 1);
    header = end == std::string_view::npos ? std::string_view() : header.substr(end + 1);
  }
  return "";
}

}  // namespace evac
