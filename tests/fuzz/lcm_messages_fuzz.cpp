#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "core/error.h"
#include "policies/messages.h"

namespace {

using Bytes = std::span<const std::uint8_t>;

const std::vector<std::string> kArms = {"right"};

void Convert(const evac::chunk_t& chunk) { evac::FromWire(chunk, kArms); }
void Convert(const evac::image_t& image) { evac::ImageOf(image); }
void Convert(const evac::episode_start_t& start) { evac::TaskOf(start); }
void Convert(const evac::hello_t& hello) { evac::SideBySide(evac::PolicySpec(), evac::FromWire(hello.harness)); }
void Convert(const evac::declaration_t& declaration) {
  const evac::PolicySpec spec = evac::FromWire(declaration.policy);
  if (evac::FromWire(evac::ToWire(spec)) != spec) std::abort();
  evac::ToJson(spec);
}
void Convert(const evac::observation_t& header) {
  for (const auto& arm : header.arms) evac::FromWire(arm, "arm");
  for (const auto& camera : header.cameras) evac::FromWire(camera);
}
void Convert(const evac::episode_started_t&) {}
void Convert(const evac::bye_t&) {}

/// The bytes after the type's fingerprint are the fuzzer's: what decodes must encode to something that decodes to the
/// same (from the second time on: LCM's encoder ends a text at a zero byte, its decoder does not, and a message made so
/// much shorter may announce more than it holds).
template <typename Message>
void Try(Bytes content) {
  std::vector<std::uint8_t> bytes;
  for (int shift = 56; shift >= 0; shift -= 8)
    bytes.push_back(static_cast<std::uint8_t>(static_cast<std::uint64_t>(Message::getHash()) >> shift));
  bytes.insert(bytes.end(), content.begin(), content.end());
  const auto message = evac::Decoded<Message>(bytes);
  if (!message) return;
  const std::vector<std::uint8_t> encoded = evac::Encoded(*message);
  const auto again = evac::Decoded<Message>(encoded);
  if (!again && encoded.size() < bytes.size()) return;
  const auto once_more = again ? evac::Decoded<Message>(evac::Encoded(*again)) : std::nullopt;
  if (!once_more || evac::Encoded(*once_more) != evac::Encoded(*again)) std::abort();
  Convert(*message);
}

/// A valid JPEG with bytes replaced: (offset, offset, value) triples.
void TryJpeg(Bytes changes) {
  evac::image_t image{};
  evac::PutImage(cv::Mat(24, 32, CV_8UC3, cv::Scalar(30, 90, 200)), 95, image);
  for (std::size_t i = 0; i + 2 < changes.size(); i += 3) {
    image.data[(changes[i] << 8 | changes[i + 1]) % image.data.size()] = changes[i + 2];
  }
  evac::ImageOf(image);
}

}  // namespace

/// Any bytes are a message that the edge understands, or nothing, or an InvalidInput: never a crash, never a huge
/// allocation.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const Bytes content(data + 1, size - 1);
  try {
    switch (data[0] % 9) {
      case 0:
        Try<evac::chunk_t>(content);
        break;
      case 1:
        Try<evac::image_t>(content);
        break;
      case 2:
        Try<evac::observation_t>(content);
        break;
      case 3:
        Try<evac::episode_start_t>(content);
        break;
      case 4:
        Try<evac::hello_t>(content);
        break;
      case 5:
        Try<evac::declaration_t>(content);
        break;
      case 6:
        Try<evac::episode_started_t>(content);
        break;
      case 7:
        Try<evac::bye_t>(content);
        break;
      case 8:
        TryJpeg(content);
        break;
    }
  } catch (const evac::Error& error) {
    if (error.exit_code() != evac::ExitCode::kInvalidInput) std::abort();
  }
  return 0;
}
