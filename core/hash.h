#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace evac {

/// SHA-256, 64 lower-case hex digits.
std::string Sha256Hex(std::string_view bytes);
/// @throws Error naming the file if it cannot be read.
std::string Sha256HexOfFile(const std::filesystem::path& path);

}  // namespace evac
