#pragma once

#include <string>

namespace evac {

/// A word of a command that somebody is to give, as a shell reads it back: `judges=[oracle]` would else be a pattern.
std::string ForShell(const std::string& word);

}  // namespace evac
