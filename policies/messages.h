#pragma once

#include <cstdint>
#include <evac/bye_t.hpp>
#include <evac/chunk_t.hpp>
#include <evac/declaration_t.hpp>
#include <evac/episode_start_t.hpp>
#include <evac/episode_started_t.hpp>
#include <evac/hello_t.hpp>
#include <evac/image_t.hpp>
#include <evac/observation_t.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/types.h"
#include "policies/spec.h"

/// The edge between the wire (policies/lcm/*.lcm, generated structs ending in _t) and our types. Bytes and messages are
/// what a stranger sent: everything here checks, nothing behind it has to.
namespace evac {

/// The message's bytes as LCM sends them.
template <typename Message>
std::vector<std::uint8_t> Encoded(const Message& message) {
  std::vector<std::uint8_t> bytes(message.getEncodedSize());
  bytes.resize(message.encode(bytes.data(), 0, static_cast<int>(bytes.size())));  // less where a text holds a zero byte
  return bytes;
}

/// The message, or nothing if these bytes are no such message. Never throws, never allocates more than a small multiple
/// of the bytes' size. Defined for the messages included above.
template <typename Message>
std::optional<Message> Decoded(std::span<const std::uint8_t> bytes);

/// Poses go as metres and unit quaternion.
arm_state_t ToWire(const ArmState& arm);
std::vector<arm_state_t> ToWire(const Arms& arms);
camera_t ToWire(const Camera& camera);
spec_t ToWire(const PolicySpec& spec);

/// Each throws InvalidInput with field, found and wanted. `where` begins the message: "target 3 of 16, right arm".
/// Accepted are finite numbers, quaternions whose norm is within 1e-3 of 1, and cameras of some size and focal length.
ArmState FromWire(const arm_state_t& arm, const std::string& where);
Camera FromWire(const camera_t& camera);
PolicySpec FromWire(const spec_t& spec);

/// A reply's targets. @param arms  the names of the arms that every target must have.
/// @throws InvalidInput if there is none, or one is not as above.
ActionChunk FromWire(const chunk_t& chunk, const std::vector<std::string>& arms);

/// What a policy may know of a task, and back: id, instruction, arms, cameras, period_s, workspace_m.
void PutTask(const Task& task, episode_start_t& start);
Task TaskOf(const episode_start_t& start);

/// Fills in encoding, size and data from an RGB image. @param jpeg_quality  nothing: raw, exact.
void PutImage(const cv::Mat& rgb, std::optional<int> jpeg_quality, image_t& message);
/// CV_8UC3 RGB. @throws InvalidInput if the data is no such image, or larger than 4096 pixels either way.
cv::Mat ImageOf(const image_t& message);

}  // namespace evac
