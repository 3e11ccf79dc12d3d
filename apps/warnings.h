#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace evac {

/// "evac: warning: …" on stderr for each of the first ones, and how many more there are.
void PrintWarnings(const std::vector<std::string>& warnings);

/// Where another version of evac began what is gone on with, a note on stderr: what a later one makes there may come
/// out otherwise. @param began  its version; empty: it wrote none down
void SayIfAnotherVersionBegan(const std::filesystem::path& out, const std::string& began);

}  // namespace evac
