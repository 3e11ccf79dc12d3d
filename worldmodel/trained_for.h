#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/tensor_file.h"
#include "core/types.h"
#include "worldmodel/action_statistics.h"

namespace evac {

/// What a network was trained for, as its weights say: `evac train world` writes into their metadata what its shards
/// say (docs/formats/shards.md). Every field may be missing: of weights that others trained, all are.
struct TrainedFor {
  std::string weights;                         ///< the file, for messages
  std::optional<double> period_s;              ///< between two frames
  std::vector<std::string> cameras;            ///< of the views, in their order; empty: not said
  std::vector<std::string> arms;               ///< {left, right} or {right}; empty: not said
  std::optional<ActionStatistics> statistics;  ///< what its actions were normalised by
  std::string pose_map;                        ///< how maps were drawn (PoseMapWords); empty: not said
  /// `told`, `measured`, or empty: not said. Compared with nothing: a policy tells targets whatever the network learned
  /// from. It says which of a recording's arms are its actions.
  std::string arms_read;

  /// @throws InvalidInput naming the file and the key: a period that is none, a page of statistics that is none.
  static TrainedFor Of(const std::string& weights, const TensorMetadata& metadata);
  /// The same of a file of weights, of which only the list of tensors is read.
  /// @throws TensorError if it is none
  static TrainedFor Read(const std::filesystem::path& weights);

  /// What actions are to be normalised by: the page's if there is one, else the weights', else AgiBot World's, as the
  /// released model's are.
  /// @throws InvalidInput if page and weights differ: the first number that does, and where each is from.
  ActionStatistics StatisticsOr(const std::optional<std::filesystem::path>& page) const;

  /// @throws InvalidInput if these differ from the weights': the first number that does
  void CheckStatistics(const ActionStatistics& asked, const std::string& who) const;

  /// @param who   for the message: "world evac"
  /// @throws InvalidInput with both periods
  void CheckPeriod(double asked_period_s, const std::string& who) const;
  /// @throws InvalidInput with both lists: other cameras, or the same in another order
  void CheckCameras(const std::vector<std::string>& asked, const std::string& who) const;
  /// @throws InvalidInput with both lists: one arm where two were, or the reverse
  void CheckArms(const std::vector<std::string>& asked, const std::string& who) const;
  /// @throws InvalidInput with both ways of drawing
  void CheckPoseMap(const std::string& asked, const std::string& who) const;
};

std::vector<std::string> NamesOf(const std::vector<Camera>& cameras);

}  // namespace evac
