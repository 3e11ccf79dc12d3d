#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

/// JSON in text that somebody else wrote: models and servers.
namespace evac {

/// The whole text as one JSON value; nothing if it is none, is not UTF-8, or nests deeper than 32.
std::optional<nlohmann::json> ParseJson(std::string_view text);

/// The first "{…}" whose braces balance, those in strings not counted. Nothing if none closes.
std::optional<std::string> FirstBalancedObject(std::string_view text);

/// Without a byte order mark and without what stands between <think> and </think>; a <think> that never ends hides all
/// the rest, a </think> without its beginning all before it.
std::string WithoutThinking(std::string_view text);

/// At most 200 bytes on one line, printable, for messages.
std::string Excerpt(std::string_view text);

}  // namespace evac
