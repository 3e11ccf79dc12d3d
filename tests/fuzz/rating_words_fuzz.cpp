#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "core/secret.h"
#include "judges/rating_words.h"

/// Whatever a browser, or somebody who plays one, sends to the rating server: bodies, ranges, cookies.
namespace {

void Require(bool holds) {
  if (!holds) std::abort();
}

template <typename T>
void OneOrTheOther(const evac::Parsed<T>& parsed) {
  Require(parsed.value.has_value() == parsed.problem.empty());
}

void CheckVerdict(std::string_view text) {
  const auto parsed = evac::ParseVerdict(text);
  OneOrTheOther(parsed);
  if (!parsed.value) return;
  const evac::HumanVerdict& verdict = *parsed.value;
  Require(evac::IsSecret(verdict.presentation) && verdict.client_uuid.size() >= 16 && verdict.client_uuid.size() <= 64);
  Require(verdict.label == "success" || verdict.label == "failure" || verdict.label == "cannot_tell");
  Require(verdict.coverage >= 0 && verdict.coverage <= 1 && std::isfinite(verdict.rt_ms) && verdict.rt_ms >= 0);
  Require(verdict.stages >= 0 && verdict.stages < 1 << 16 && verdict.note.size() <= 2000 && verdict.tab_epoch >= 0);
  Require(!verdict.confidence || (*verdict.confidence >= 1 && *verdict.confidence <= 3));
}

void CheckRange(std::string_view text) {
  for (const std::uint64_t size : {std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{100'000}, UINT64_MAX}) {
    const auto range = evac::ParseRange(text, size);
    if (range) Require(range->count > 0 && range->first < size && range->count <= size - range->first);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  CheckVerdict(text);
  CheckRange(text);
  OneOrTheOther(evac::ParseJoin(text));
  OneOrTheOther(evac::ParseNext(text));
  OneOrTheOther(evac::ParseRetract(text));
  OneOrTheOther(evac::ParsePresentation(text));
  OneOrTheOther(evac::ParseWithdraw(text));
  OneOrTheOther(evac::ParseGuess(text));
  const auto from = evac::ParseFrom(text);
  Require(!from || text.empty() || text.starts_with("from="));
  const std::string_view cookie = evac::CookieOf(text, "evac_rating");
  Require(cookie.find(';') == std::string_view::npos);
  return 0;
}
