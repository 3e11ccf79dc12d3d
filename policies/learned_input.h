#pragma once

#include <string>

#include "core/types.h"
#include "core/weight_file.h"

/// What a learned policy is told, as numbers: the same when it is trained and when it acts.
namespace evac {

/// What the card's `format` must be.
inline constexpr const char* kLearnedFormat = "evac-policy-learned 1";

/// An arm as 10 numbers: xyz (metres), the first two columns of its rotation, closure.
void PutArm(const ArmState& arm, float* numbers);
/// Back again: columns made orthonormal (Zhou et al. 2019), closure within [0, 1].
ArmState ArmFrom(const float* numbers);

/// Where a camera is and how its rays go: 9 numbers, row by row, of the matrix that takes (x, y in parts of the
/// picture, 1) to the direction of that pixel's ray, and 3 of where it stands; base frame, metres.
void PutRays(const Camera& camera, const Eigen::Isometry3d& base_from_camera, float* rays, float* eye);

/// A camera as a line of the card, and back: mount, focal lengths and middle in parts of the picture,
/// mount_from_camera.
std::string CardLine(const Camera& camera);
/// Field `camera.<name>`; of the size 1x1. @throws InvalidInput naming file and field.
Camera CameraOfCard(const WeightFile& file, const std::string& name);

}  // namespace evac
