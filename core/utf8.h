#pragma once

#include <cstddef>
#include <string_view>

namespace evac {

/// Length in bytes (1 to 4) of the well-formed UTF-8 sequence at the front of a text that is not empty; 0 if there is
/// none: overlong forms, surrogates, beyond U+10FFFF, cut short (Unicode 15, table 3-7).
std::size_t Utf8Length(std::string_view text);

/// Length in bytes of the well-formed part at the front: the text's own length if all of it is UTF-8.
std::size_t Utf8Prefix(std::string_view text);

}  // namespace evac
