#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace evac {

/// A file within a zip, as it lies there.
struct ZipEntry {
  std::string name;
  std::span<const std::byte> bytes;
};

/// The files of a zip whose files are stored, not compressed, as torch.save writes it; larger than 4 GiB too.
/// @param name  stands for the file in messages
/// @throws TensorError: no zip, cut off, compressed, encrypted, in several parts, sizes that disagree, a name twice.
std::vector<ZipEntry> ReadZip(std::span<const std::byte> file, const std::string& name);

}  // namespace evac
