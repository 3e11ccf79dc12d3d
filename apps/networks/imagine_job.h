#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "apps/networks/imagine.h"
#include "core/video.h"

namespace evac {

/// Everything that decides the frames of `evac imagine`: two jobs that are equal imagine the same bytes on one machine.
/// Names and numbers alone, hashes for what is large; no paths.
nlohmann::json JobOf(const ImagineArguments& arguments, const ImagineStart& start);

/// OUT/imagined.json: what was asked for and, at the end, what came of it. Enough to do it again.
class Sidecar {
 public:
  /// @throws InvalidInput if `out` holds another job, naming what differs, unless `restart`; then what is there
  /// is removed. Also where somebody's files would go: maps or frames with others in them, frames that no job of `out`
  /// made, an imagined.json that is none, or a file that is read and lies in what is to be replaced.
  Sidecar(const ImagineArguments& arguments, const ImagineStart& start, nlohmann::json job);

  /// Of the job as a whole.
  const std::string& hash() const { return hash_; }
  /// Says that it is not finished yet.
  void WriteBegun() const;
  void WriteFinished(const FinishedVideo& video, double seconds) const;

 private:
  void Refuse(const nlohmann::json& job) const;
  void Write(const nlohmann::json& page) const;

  std::filesystem::path out_;
  nlohmann::json page_;  ///< job, inputs, command
  std::string hash_;
};

}  // namespace evac
