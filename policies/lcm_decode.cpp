#include <array>
#include <type_traits>

#include "policies/messages.h"

namespace evac {
namespace {

constexpr std::size_t kHashBytes = 8;

/// What a message announces before anything else: for each count, the fewest bytes one element takes.
template <typename Message>
constexpr std::array<int, 0> kBytesPerElement = {};
template <>
constexpr std::array<int, 1> kBytesPerElement<image_t> = {1};
template <>
constexpr std::array<int, 2> kBytesPerElement<observation_t> = {64, 125};  // arm_state_t, camera_t
template <>
constexpr std::array<int, 2> kBytesPerElement<episode_start_t> = {5, 125};  // string, camera_t
template <>
constexpr std::array<int, 3> kBytesPerElement<hello_t> = {5, 13, 5};  // of its spec_t: string, camera_need_t, string
template <>
constexpr std::array<int, 3> kBytesPerElement<declaration_t> = kBytesPerElement<hello_t>;
template <>
constexpr std::array<int, 2> kBytesPerElement<chunk_t> = {64, 0};  // targets of one arm; arms: see CountsFit

std::int64_t CountAt(std::span<const std::uint8_t> bytes, std::size_t index) {
  const std::uint8_t* at = bytes.data() + kHashBytes + 4 * index;
  return static_cast<std::int32_t>(std::uint32_t{at[0]} << 24 | std::uint32_t{at[1]} << 16 | std::uint32_t{at[2]} << 8 | at[3]);
}

/// Whether the arrays that the message announces can be in these bytes at all; asked before the generated code allocates them.
template <typename Message>
bool CountsFit(std::span<const std::uint8_t> bytes) {
  constexpr auto& bytes_each = kBytesPerElement<Message>;
  if (bytes.size() < kHashBytes + 4 * bytes_each.size()) return false;
  const std::int64_t size = static_cast<std::int64_t>(bytes.size());
  for (std::size_t i = 0; i < bytes_each.size(); ++i) {
    const std::int64_t count = CountAt(bytes, i);
    if (count < 0 || count * bytes_each[i] > size) return false;
  }
  constexpr bool is_two_dimensional = std::is_same_v<Message, chunk_t>;
  return !is_two_dimensional || CountAt(bytes, 1) <= 2;
}

}  // namespace

template <typename Message>
std::optional<Message> Decoded(std::span<const std::uint8_t> bytes) try {
  if (bytes.size() < kHashBytes || !CountsFit<Message>(bytes)) return std::nullopt;
  Message message{};
  if (message.decode(bytes.data(), 0, static_cast<int>(bytes.size())) < 0) return std::nullopt;
  return message;
} catch (const std::exception&) {  // the generated code builds strings from lengths it does not check
  return std::nullopt;
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
