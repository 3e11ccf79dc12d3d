#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "core/error.h"
#include "core/store_codec.h"

namespace evac::codec {
namespace {

static_assert(std::endian::native == std::endian::little, "the blobs are little-endian and copied as they are");

class Packer {
 public:
  template <typename Number>
  void Put(Number number) {
    bytes_.append(reinterpret_cast<const char*>(&number), sizeof(number));
  }
  void PutCount(std::size_t count) { Put(static_cast<std::uint32_t>(count)); }
  void PutText(const std::string& text) {
    PutCount(text.size());
    bytes_ += text;
  }
  void PutPose(const Eigen::Isometry3d& pose) {
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) Put(pose.matrix()(row, column));
    }
  }
  std::string Take() { return std::move(bytes_); }

 private:
  std::string bytes_;
};

class Unpacker {
 public:
  explicit Unpacker(std::string_view bytes) : bytes_(bytes) {}

  template <typename Number>
  Number Get() {
    Number number;
    std::memcpy(&number, Take(sizeof(number)).data(), sizeof(number));
    return number;
  }
  /// A number of things of at least `least_size` bytes each: never more than there are bytes for.
  std::size_t GetCount(std::size_t least_size) {
    const std::size_t count = Get<std::uint32_t>();
    if (count > bytes_.size() / least_size) ThrowDamaged();
    return count;
  }
  std::string GetText() { return std::string(Take(GetCount(1))); }
  Eigen::Isometry3d GetPose() {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) pose.matrix()(row, column) = Get<double>();
    }
    return pose;
  }
  void ExpectEnd() const {
    if (!bytes_.empty()) ThrowDamaged();
  }
  [[noreturn]] static void ThrowDamaged() {
    throw InternalError("the store is damaged: a blob does not have the length it states");
  }

 private:
  std::string_view Take(std::size_t size) {
    if (size > bytes_.size()) ThrowDamaged();
    const std::string_view taken = bytes_.substr(0, size);
    bytes_.remove_prefix(size);
    return taken;
  }
  std::string_view bytes_;
};

/// Every body's name once, sorted: frames name them by their place here.
std::vector<std::string> BodyNames(const PrivilegedTrack& track) {
  std::vector<std::string> names;
  for (const PrivilegedFrame& frame : track) {
    for (const auto& body : frame.bodies) names.push_back(body.name);
    for (const auto& contact : frame.contacts) names.insert(names.end(), {contact.a, contact.b});
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

void PutName(Packer& packer, const std::vector<std::string>& names, const std::string& name) {
  packer.PutCount(static_cast<std::size_t>(std::lower_bound(names.begin(), names.end(), name) - names.begin()));
}

const std::string& GetName(Unpacker& unpacker, const std::vector<std::string>& names) {
  const std::size_t place = unpacker.Get<std::uint32_t>();
  if (place >= names.size()) Unpacker::ThrowDamaged();
  return names[place];
}

}  // namespace

std::string EncodeArms(const std::vector<ArmsStep>& steps) {
  Packer packer;
  packer.PutCount(steps.size());
  for (const ArmsStep& step : steps) {
    packer.Put(static_cast<std::uint8_t>(step.are_commanded));
    packer.PutCount(step.arms.size());
    for (const ArmState& arm : step.arms) {
      packer.PutPose(arm.base_from_gripper);
      packer.Put(arm.closure);
    }
  }
  return packer.Take();
}

std::vector<ArmsStep> DecodeArms(std::string_view bytes) {
  Unpacker unpacker(bytes);
  std::vector<ArmsStep> steps(unpacker.GetCount(5));
  for (ArmsStep& step : steps) {
    step.are_commanded = unpacker.Get<std::uint8_t>() != 0;
    step.arms.resize(unpacker.GetCount(13 * sizeof(double)));
    for (ArmState& arm : step.arms) {
      arm.base_from_gripper = unpacker.GetPose();
      arm.closure = unpacker.Get<double>();
    }
  }
  unpacker.ExpectEnd();
  return steps;
}

std::string EncodePrivileged(const PrivilegedTrack& track) {
  const std::vector<std::string> names = BodyNames(track);
  Packer packer;
  packer.PutCount(names.size());
  for (const std::string& name : names) packer.PutText(name);
  packer.PutCount(track.size());
  for (const PrivilegedFrame& frame : track) {
    packer.PutCount(frame.bodies.size());
    for (const auto& body : frame.bodies) {
      PutName(packer, names, body.name);
      packer.PutPose(body.base_from_body);
    }
    packer.PutCount(frame.contacts.size());
    for (const auto& contact : frame.contacts) {
      PutName(packer, names, contact.a);
      PutName(packer, names, contact.b);
      packer.Put(contact.force_n);
    }
  }
  return packer.Take();
}

PrivilegedTrack DecodePrivileged(std::string_view bytes) {
  Unpacker unpacker(bytes);
  std::vector<std::string> names(unpacker.GetCount(4));
  for (std::string& name : names) name = unpacker.GetText();
  PrivilegedTrack track(unpacker.GetCount(8));
  for (PrivilegedFrame& frame : track) {
    frame.bodies.resize(unpacker.GetCount(4 + 12 * sizeof(double)));
    for (auto& body : frame.bodies) {
      body.name = GetName(unpacker, names);
      body.base_from_body = unpacker.GetPose();
    }
    frame.contacts.resize(unpacker.GetCount(8 + sizeof(double)));
    for (auto& contact : frame.contacts) {
      contact.a = GetName(unpacker, names);
      contact.b = GetName(unpacker, names);
      contact.force_n = unpacker.Get<double>();
    }
  }
  unpacker.ExpectEnd();
  return track;
}

std::string EncodePng(const cv::Mat& rgb) {
  if (rgb.empty() || rgb.type() != CV_8UC3) throw InternalError("an initial scene's image is no 8-bit RGB image");
  cv::Mat bgr;
  cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
  std::vector<unsigned char> png;
  cv::imencode(".png", bgr, png);
  return std::string(png.begin(), png.end());
}

cv::Mat DecodePng(std::string_view png) {
  const cv::Mat bytes(1, static_cast<int>(png.size()), CV_8U, const_cast<char*>(png.data()));
  cv::Mat rgb;
  if (!png.empty()) cv::imdecode(bytes, cv::IMREAD_COLOR, &rgb);
  if (rgb.empty()) throw InternalError("the store is damaged: an initial scene's image is no PNG");
  cv::cvtColor(rgb, rgb, cv::COLOR_BGR2RGB);
  return rgb;
}

}  // namespace evac::codec
