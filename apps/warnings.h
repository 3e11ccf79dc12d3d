#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace evac {

/// "evac: warning: …" on stderr for each of the first ones, and how many more there are.
void PrintWarnings(const std::vector<std::string>& warnings);

/// Where another version of evac began what is gone on with, a note on stderr: what a later one makes there may come
/// out otherwise. @param what  a folder, or "the latents …". @param began  its version; empty: it wrote none down
void SayIfAnotherVersionBegan(const std::string& what, const std::string& began);

/// Writes into `file` which version of evac begins something; where it was begun before, SayIfAnotherVersionBegan of
/// what stands there. @param is_begun  something of it is there and will stay
void KeepWhoBegan(const std::filesystem::path& file, bool is_begun, const std::string& what);

/// A warning for each subfolder of a folder of recordings that holds none: what lies deeper is not looked for.
void SayPassedOver(const std::filesystem::path& recordings);

}  // namespace evac
