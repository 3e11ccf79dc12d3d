#pragma once

#include <opencv2/core.hpp>

namespace evac {

/// The picture with the masked pixels filled in from those around them, each from the smallest square about it of which
/// at least a twentieth is not masked (31 px, 63, 127, …). Of a picture that shows nothing else all is grey.
/// @param rgb   8-bit, three channels
/// @param mask  of its size, 8-bit; masked: not 0
cv::Mat PaintedOver(const cv::Mat& rgb, const cv::Mat& mask);

}  // namespace evac
