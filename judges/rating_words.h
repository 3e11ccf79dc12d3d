#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/store_study.h"

/// What a rater's browser sends: bodies, ids and ranges. Any bytes may come; what is returned keeps to the ranges of
/// docs/formats/study.md, or there is a sentence saying what is wrong.
namespace evac {

/// A value, or what is wrong with the text: "label: found 'yes', wanted success, failure or cannot_tell".
template <typename T>
struct Parsed {
  std::optional<T> value{};
  std::string problem{};
};

struct JoinBody {
  std::string invite, uuid, name;
};
Parsed<JoinBody> ParseJoin(std::string_view text);

inline constexpr int kMostStages = 16;  ///< of a task that is rated: a verdict says of so many which were reached

/// What a tab asks for: its epoch and what it holds already.
struct NextBody {
  std::int64_t tab_epoch = 0;
  std::vector<std::string> held;
};
Parsed<NextBody> ParseNext(std::string_view text);

/// @returns a verdict without what the server knows itself: id, rater, clip, time, ua_hash, version.
Parsed<HumanVerdict> ParseVerdict(std::string_view text);

struct RetractBody {
  std::int64_t tab_epoch = 0;
  std::string uuid;     ///< of the new row
  std::string of_uuid;  ///< of the verdict that is undone
};
Parsed<RetractBody> ParseRetract(std::string_view text);

struct PresentationBody {
  std::int64_t tab_epoch = 0;
  std::string presentation;
  std::string reason;  ///< why it cannot be played; else empty
};
Parsed<PresentationBody> ParsePresentation(std::string_view text);

struct WithdrawBody {
  bool keep = false, erase = false;
};
Parsed<WithdrawBody> ParseWithdraw(std::string_view text);

struct GuessBody {
  std::string presentation, guess;
};
Parsed<GuessBody> ParseGuess(std::string_view text);

/// The flags and causes that may be given, as the page names them.
const std::vector<std::string>& RatingFlags();
const std::vector<std::string>& FailureCauses();

/// "bytes=0-", "bytes=5-9", "bytes=-4" of a file: the first byte and how many.
struct ByteRange {
  std::uint64_t first = 0, count = 0;
};
/// Whether it is one such range, be it inside of the file or not. Any other header is to be ignored (RFC 9110, 14.2).
bool IsOneRange(std::string_view header);
/// Nothing if it is another kind, more than one, or outside of the file.
std::optional<ByteRange> ParseRange(std::string_view header, std::uint64_t size);

/// "" or "from=200" of a question for part of a list: where it begins.
std::optional<std::size_t> ParseFrom(std::string_view query);

/// The value of one cookie in a Cookie header, or "".
std::string_view CookieOf(std::string_view header, std::string_view name);

}  // namespace evac
