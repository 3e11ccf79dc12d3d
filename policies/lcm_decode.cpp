#include "policies/messages.h"

namespace evac {
namespace {

constexpr std::size_t kArmStateBytes = 64;  ///< 3 + 4 + 1 doubles

/// Walks over a message's bytes as its type lays them out, and notes if they do not hold what they announce. The
/// generated decoders need this done first: they allocate what a count says, and compute with a text's length,
/// unchecked.
class Walk {
 public:
  explicit Walk(std::span<const std::uint8_t> bytes) : bytes_(bytes) { Fixed(8); }  // the type's fingerprint

  bool is_whole() const { return is_whole_; }

  void Fixed(std::size_t size) {
    is_whole_ = is_whole_ && size <= bytes_.size() - at_;
    at_ += is_whole_ ? size : 0;
  }

  /// A count or a length: none is larger than the message, in bytes.
  std::size_t Number(std::int64_t least = 0) {
    const std::size_t at = at_;
    Fixed(4);
    if (!is_whole_) return 0;
    const std::uint8_t* b = bytes_.data() + at;
    const auto number = static_cast<std::int32_t>(std::uint32_t{b[0]} << 24 | std::uint32_t{b[1]} << 16 |
                                                  std::uint32_t{b[2]} << 8 | b[3]);
    is_whole_ = number >= least && number <= static_cast<std::int64_t>(bytes_.size());
    return is_whole_ ? static_cast<std::size_t>(number) : 0;
  }

  /// Length, characters, a zero byte that the length counts.
  void Texts(std::size_t count = 1) {
    for (std::size_t i = 0; i < count && is_whole_; ++i) Fixed(Number(1));
  }

  void Spec() {
    const std::size_t arms = Number(), cameras = Number(), needs = Number();
    Texts(6);
    Fixed(3 * 8 + 4);
    Texts(arms);
    for (std::size_t i = 0; i < cameras && is_whole_; ++i) Texts(), Fixed(2 * 4);
    Texts(needs);
  }

  void Cameras(std::size_t count) {
    for (std::size_t i = 0; i < count && is_whole_; ++i) Texts(), Fixed(2 * 4 + 4 * 8 + 1 + 7 * 8);
  }

 private:
  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  bool is_whole_ = true;
};

void Over(Walk& walk, const hello_t*) { walk.Spec(), walk.Texts(); }

void Over(Walk& walk, const declaration_t*) { walk.Spec(), walk.Texts(2); }

void Over(Walk& walk, const bye_t*) { walk.Texts(); }

void Over(Walk& walk, const episode_started_t*) { walk.Texts(2), walk.Fixed(8), walk.Texts(); }

void Over(Walk& walk, const image_t*) {
  const std::size_t bytes = walk.Number();
  walk.Texts();
  walk.Fixed(2 * 8 + 4);
  walk.Texts();
  walk.Fixed(2 * 4 + 1 + bytes);
}

void Over(Walk& walk, const observation_t*) {
  const std::size_t arms = walk.Number(), images = walk.Number();
  walk.Texts();
  walk.Fixed(2 * 8 + 4);
  walk.Texts(2);
  walk.Fixed(8 + 1 + arms * kArmStateBytes);
  walk.Cameras(images);
}

void Over(Walk& walk, const episode_start_t*) {
  const std::size_t arms = walk.Number(), cameras = walk.Number();
  walk.Texts();
  walk.Fixed(8 + 4 + 8);
  walk.Texts(2);
  walk.Fixed(8 + 2 * 24);
  walk.Texts(arms);
  walk.Cameras(cameras);
}

void Over(Walk& walk, const chunk_t*) {
  const std::size_t targets = walk.Number();
  const std::size_t arms = walk.Number(targets > 0 ? 1 : 0);
  walk.Texts(2);
  walk.Fixed(3 * 8);
  walk.Texts();
  walk.Fixed(2 + targets * arms * kArmStateBytes);
}

}  // namespace

template <typename Message>
std::optional<Message> Decoded(std::span<const std::uint8_t> bytes) {
  Walk walk(bytes);
  Over(walk, static_cast<const Message*>(nullptr));
  Message message{};
  if (!walk.is_whole() || message.decode(bytes.data(), 0, static_cast<int>(bytes.size())) < 0) return std::nullopt;
  return message;
}

template std::optional<bye_t> Decoded(std::span<const std::uint8_t>);
template std::optional<chunk_t> Decoded(std::span<const std::uint8_t>);
template std::optional<declaration_t> Decoded(std::span<const std::uint8_t>);
template std::optional<episode_start_t> Decoded(std::span<const std::uint8_t>);
template std::optional<episode_started_t> Decoded(std::span<const std::uint8_t>);
template std::optional<hello_t> Decoded(std::span<const std::uint8_t>);
template std::optional<image_t> Decoded(std::span<const std::uint8_t>);
template std::optional<observation_t> Decoded(std::span<const std::uint8_t>);

}  // namespace evac
