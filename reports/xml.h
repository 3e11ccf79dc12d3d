#pragma once

#include <string>
#include <string_view>

namespace evac {

/// Text for the inside of an XML 1.0 element: & < > " ' become entities; what XML cannot hold at all (control
/// characters, U+FFFE, U+FFFF, bytes that are no UTF-8) becomes U+FFFD.
std::string XmlText(std::string_view text);

/// The same for a quoted attribute, whose line ends and tabs a parser would otherwise turn into blanks.
std::string XmlAttribute(std::string_view text);

}  // namespace evac
