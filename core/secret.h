#pragma once

#include <string>
#include <string_view>

/// Words that nobody can guess: links, sessions, names of clips.
namespace evac {

/// 128 bits from the system's own source, as 32 lower-case hex digits. Never from a seed. @throws Error without a
/// source.
std::string NewSecret();

/// Whether two texts are equal; how long it takes tells their lengths alone.
bool SameSecret(std::string_view a, std::string_view b);

/// Whether it looks like one of NewSecret's: 32 digits 0-9 a-f.
bool IsSecret(std::string_view text);

}  // namespace evac
