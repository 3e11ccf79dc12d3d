#pragma once

#include <string>
#include <string_view>

namespace evac {

/// Text for the inside of an element or a quoted attribute: & < > " ' become entities, control characters U+FFFD, and
/// so do bytes that are no UTF-8. Everything that comes from a suite, a policy or a judge passes here.
std::string Escaped(std::string_view text);

/// The same with places where a long name may be broken: after '_', '@', '/'.
std::string Breakable(std::string_view text);

/// A relative link to a file: every byte that is not a letter, digit, or one of -._~/@ is percent-encoded, then
/// escaped.
std::string Link(std::string_view relative_path);

/// An id for use in `id=` and `href="#…"`: letters, digits and '-', others become "_xx" (hex); distinct texts stay
/// distinct.
std::string Anchor(std::string_view text);

}  // namespace evac
