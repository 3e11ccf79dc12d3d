#include "core/weight_file.h"

#include <fmt/ranges.h>

#include <charconv>
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "core/names.h"

namespace evac {
namespace {

TensorFile Open(const std::filesystem::path& path) try {
  return TensorFile::Open(path);
} catch (const TensorError& error) {
  throw InvalidInput("{}", error.what());
}

/// @throws InvalidInput for the first number that is none: whatever is computed with it is none either, and compares
/// with nothing.
void RequireFinite(const TensorView& view, const std::string& file) {
  for (std::size_t at = 0; at + sizeof(float) <= view.bytes.size(); at += sizeof(float)) {
    float number = 0;
    std::memcpy(&number, &view.bytes[at], sizeof number);
    if (!std::isfinite(number))
      throw InvalidInput("{}: {}: number {} is {}, wanted a finite one", file, view.name, at / sizeof number, number);
  }
}

}  // namespace

WeightFile::WeightFile(const std::filesystem::path& path, const std::string& format) : file_(Open(path)) {
  const auto found = card().find("format");
  const std::string is = found == card().end() ? "nothing that says what it is" : "'" + found->second + "'";
  if (found == card().end() || found->second != format)
    throw InvalidInput("{}: the weights are of format {}, wanted '{}'", name(), is, format);
}

const std::string& WeightFile::Text(const std::string& field) const {
  const auto found = card().find(field);
  if (found == card().end()) throw InvalidInput("{}: the card has no field '{}'", name(), field);
  return found->second;
}

double WeightFile::Number(const std::string& field) const {
  const std::string& text = Text(field);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    throw InvalidInput("{}: card field '{}': found '{}', wanted a number", name(), field, text);
  return value;
}

int WeightFile::Whole(const std::string& field, int low, int high) const {
  const double value = Number(field);
  if (value < low || value > high || value != std::floor(value))
    throw InvalidInput("{}: card field '{}': found {}, wanted a whole number in {} … {}", name(), field, value, low,
                       high);
  return static_cast<int>(value);
}

std::vector<std::string> WeightFile::Names(const std::string& field) const {
  std::vector<std::string> names = NamesIn(Text(field));
  for (const std::string& part : names) {
    if (part.empty()) names.clear();
  }
  if (names.empty() || std::set(names.begin(), names.end()).size() != names.size())
    throw InvalidInput("{}: card field '{}': found '{}', wanted different names with commas between them", name(),
                       field, Text(field));
  return names;
}

const TensorView& WeightFile::Take(const std::string& tensor, const std::vector<std::int64_t>& shape) {
  if (!file_.Has(tensor)) throw InvalidInput("{}: there is no tensor '{}'", name(), tensor);
  const TensorView& view = file_.Get(tensor);
  if (view.type != TensorType::kF32 || view.shape != shape)
    throw InvalidInput("{}: {} is {} [{}], wanted F32 [{}]", name(), tensor, evac::Name(view.type),
                       fmt::join(view.shape, ", "), fmt::join(shape, ", "));
  RequireFinite(view, name());
  taken_.insert(tensor);
  return view;
}

void WeightFile::RequireAllTaken() const {
  for (const TensorView& tensor : file_.tensors()) {
    if (!taken_.contains(tensor.name)) throw InvalidInput("{}: nothing reads tensor '{}'", name(), tensor.name);
  }
}

}  // namespace evac
