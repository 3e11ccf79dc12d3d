#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/recording.h"

namespace evac {

/// Where `evac imagine` gets its first frame and its actions from: a recording's folder, or four files.
struct ImagineInputs {
  std::string recording;             ///< a folder (docs/formats/recording.md); empty: `files`
  RecordingFiles files;              ///< the head camera alone
  std::vector<std::string> cameras;  ///< the views, in this order; empty: the first V that are there, head first
  int stride = 0;         ///< every nth recorded step is one frame; 0: as many as make `period_s`
  double period_s = 0.1;  ///< the network's; the released model's, unless its weights say another
  std::string arms;       ///< told or measured: which of a recording's are the actions; empty: `read_told`
  bool read_told = false;  ///< the arms are where they were told to be, if the recording says so; else where they were
};

/// The first frame, and what the arms do from then on.
struct ImagineStart {
  InitialScene scene;      ///< of V cameras
  std::vector<Arms> arms;  ///< [T], T >= 2: where they begin, then one target per frame to imagine
  std::vector<std::string> arm_names;  ///< the recording's
  double period_s = 0;     ///< between them; the asked one where they are within 2 % of it
  int stride = 1;          ///< recorded steps per frame
  std::string source;      ///< one sentence
  std::vector<std::filesystem::path> files;
};

/// Reads and checks everything; writes nothing.
/// @throws InvalidInput naming file, field, found and wanted; also unless either the folder or all four files are
/// named, unless there is one camera for each view, for fewer than two steps, and where told arms are asked for and
/// not recorded.
ImagineStart ReadImagineStart(const ImagineInputs& inputs, std::size_t views);

/// SHA-256 of what was read, whatever the files it came from: images, cameras, and arms.
std::string HashOf(const InitialScene& scene);
std::string HashOf(const std::vector<Arms>& arms);

}  // namespace evac
