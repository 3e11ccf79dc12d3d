#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "core/types.h"

/// How the store writes what is no plain column: little-endian blobs, PNG and JSON, all exact to the last bit
/// (docs/formats/run.md). Decoders throw Error for damaged bytes.
namespace evac::codec {

/// One moment of an arm track.
struct ArmsStep {
  Arms arms;
  bool are_commanded = false;
};

std::string EncodeArms(const std::vector<ArmsStep>& steps);
std::vector<ArmsStep> DecodeArms(std::string_view bytes);

std::string EncodePrivileged(const PrivilegedTrack& track);
PrivilegedTrack DecodePrivileged(std::string_view bytes);

/// @param rgb  CV_8UC3.
std::string EncodePng(const cv::Mat& rgb);
cv::Mat DecodePng(std::string_view png);

std::string EncodeCameras(const std::vector<Camera>& cameras);
std::vector<Camera> DecodeCameras(const std::string& json);

/// All of a task but `page` and `page_path`.
std::string EncodeTask(const Task& task);
Task DecodeTask(const std::string& json);

std::string EncodeStages(const std::map<std::string, bool>& stages);
std::map<std::string, bool> DecodeStages(const std::string& json);

}  // namespace evac::codec
