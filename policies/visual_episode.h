#pragma once

#include <optional>

#include "core/types.h"
#include "policies/visual_motion.h"
#include "policies/visual_options.h"
#include "policies/visual_things.h"

namespace evac {

/// One episode of `visual_pick`, from the first picture to rest:
///   look (head camera) → go above → look closer (wrist camera) → descend, close, lift ⟲ empty? → carry, lower, open,
///   retreat, rest
/// The looks and the check of the hand happen when a request comes; between them its chunks follow a Timeline.
class VisualEpisode {
 public:
  /// @throws InvalidInput for a task it does not know or without a camera named "head".
  VisualEpisode(const Task& task, const VisualPickOptions& options, std::uint64_t seed);

  /// The next `chunk_size` targets. The harness executes all of them before it asks again.
  ActionChunk Answer(const Observation& observation);

 private:
  /// What the arm does from `begin` (a count of targets since the episode's start) on.
  struct Plan {
    Timeline path;
    HandSchedule hand;
    int begin = 0;
    bool transfers = false;               ///< takes and places; else it only goes above the thing
    double lifted_s = 0, lowering_s = 0;  ///< between these the thing should be in the hand
    Eigen::Isometry3d gripper_from_thing = Eigen::Isometry3d::Identity();
    bool checked = false;  ///< whether it is there has been looked at
  };
  /// What one request shows: the pictures, unless it is blind to them, and the noise that goes with it.
  struct Glance {
    std::optional<View> head, hand;
    Eigen::Isometry3d base_from_gripper;
    Eigen::Vector2d error_m;
  };

  Glance GlanceAt(const Observation& observation);
  void Look(const Glance& glance);
  void LookCloser(const Glance& glance);
  bool ArrivedAbove(const Glance& glance) const;
  bool HandIsEmpty(const Glance& glance);
  Plan Approach() const;
  Plan Transfer(const Eigen::Vector2d& error_m) const;
  Eigen::Isometry3d Release() const;
  double Clock() const;

  Task task_;
  VisualPickOptions options_;
  SpeedLimits limits_;
  PickKnowledge knowledge_;
  std::uint64_t seed_;
  bool blind_ = false;
  Eigen::Vector2d error_m_;        ///< of this episode: bias and noise
  Eigen::Vector2d place_error_m_;  ///< of this episode, of where it puts things
  int requests_ = 0, told_ = 0;  ///< requests answered and targets given so far
  int retries_left_;
  Eigen::Isometry3d home_ = Eigen::Isometry3d::Identity();  ///< where the gripper was at first, and rests at last
  ArmState last_;                                           ///< the last target; at first the observed arm
  std::optional<ArmState> left_;                            ///< where a left arm was at first, and what it holds on to
  Placement thing_, target_;                                ///< where they are taken to be
  std::optional<Plan> plan_;                                ///< none before the first look
};

}  // namespace evac
