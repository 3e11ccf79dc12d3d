#include "core/npy.h"

#include <fmt/ranges.h>

#include <bit>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <type_traits>

#include "core/error.h"
#include "core/file.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
static_assert(std::endian::native == std::endian::little,
              "numbers are copied from and to little-endian files as they are");

constexpr std::string_view kMagic = "\x93NUMPY";
constexpr std::uintmax_t kMaxFileBytes = 1u << 30;
constexpr std::size_t kMaxHeaderBytes = 1u << 16;
constexpr std::size_t kMaxDimensions = 8;
constexpr std::size_t kAlignment = 64;  // of the data in the file, as numpy writes it

struct Header {
  std::string dtype;
  bool fortran_order = false;
  std::vector<std::size_t> shape;
};

/// Reads the header's Python dictionary, e.g. {'descr': '<f8', 'fortran_order': False, 'shape': (334, 16), }.
class HeaderParser {
 public:
  HeaderParser(std::string_view text, const std::string& name) : text_(text), name_(name) {}

  Header Parse() {
    Header header;
    bool has_dtype = false, has_order = false, has_shape = false;
    Expect('{');
    while (!Accept('}')) {
      const std::string key = String();
      Expect(':');
      if (key == "descr" && !has_dtype)
        header.dtype = String(), has_dtype = true;
      else if (key == "fortran_order" && !has_order)
        header.fortran_order = Bool(), has_order = true;
      else if (key == "shape" && !has_shape)
        header.shape = Tuple(), has_shape = true;
      else
        throw Broken();
      if (!Accept(',')) {
        Expect('}');
        break;
      }
    }
    SkipSpace();
    if (!text_.empty() || !has_dtype || !has_order || !has_shape) throw Broken();
    return header;
  }

 private:
  Error Broken() const {
    return InvalidInput("{}: the .npy header is broken; wanted a dictionary of descr, fortran_order and shape", name_);
  }
  void SkipSpace() {
    while (!text_.empty() && std::isspace(static_cast<unsigned char>(text_.front()))) text_.remove_prefix(1);
  }
  bool Accept(char wanted) {
    SkipSpace();
    if (text_.empty() || text_.front() != wanted) return false;
    text_.remove_prefix(1);
    return true;
  }
  void Expect(char wanted) {
    if (!Accept(wanted)) throw Broken();
  }
  std::string String() {
    SkipSpace();
    if (text_.empty() || (text_.front() != '\'' && text_.front() != '"')) throw Broken();
    const std::size_t end = text_.find(text_.front(), 1);
    if (end == std::string_view::npos) throw Broken();
    std::string value(text_.substr(1, end - 1));
    text_.remove_prefix(end + 1);
    return value;
  }
  bool Bool() {
    SkipSpace();
    for (const std::string_view word : {"True", "False"}) {
      if (!text_.starts_with(word)) continue;
      text_.remove_prefix(word.size());
      return word == "True";
    }
    throw Broken();
  }
  std::size_t Number() {
    SkipSpace();
    std::size_t value = 0;
    const auto [end, error] = std::from_chars(text_.data(), text_.data() + text_.size(), value);
    if (error != std::errc()) throw Broken();
    text_.remove_prefix(static_cast<std::size_t>(end - text_.data()));
    return value;
  }
  std::vector<std::size_t> Tuple() {
    std::vector<std::size_t> shape;
    Expect('(');
    while (!Accept(')')) {
      if (shape.size() == kMaxDimensions) throw InvalidInput("{}: more than {} dimensions", name_, kMaxDimensions);
      shape.push_back(Number());
      if (!Accept(',')) {
        Expect(')');
        break;
      }
    }
    return shape;
  }

  std::string_view text_;
  const std::string& name_;
};

template <typename T>
double NumberAt(const char* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return static_cast<double>(value);
}

template <typename T>
void AppendNumber(std::string& bytes, double number) {
  if constexpr (std::is_integral_v<T>) {  // !(…): a NaN is refused too
    const double low = static_cast<double>(std::numeric_limits<T>::min()),
                 beyond = std::ldexp(1.0, std::numeric_limits<T>::digits);
    if (!(number >= low && number < beyond)) throw InvalidInput("array: {} does not fit its integer type", number);
  } else if (std::isfinite(number) && !(std::abs(number) <= static_cast<double>(std::numeric_limits<T>::max()))) {
    throw InvalidInput("array: {} does not fit its floating-point type", number);
  }
  const T value = static_cast<T>(number);
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

struct Type {
  std::string_view dtype;
  std::size_t bytes;
  double (*read)(const char*);
  void (*append)(std::string&, double);
};

constexpr Type kTypes[] = {{"<f8", 8, NumberAt<double>, AppendNumber<double>},
                           {"<f4", 4, NumberAt<float>, AppendNumber<float>},
                           {"<i8", 8, NumberAt<std::int64_t>, AppendNumber<std::int64_t>},
                           {"<i4", 4, NumberAt<std::int32_t>, AppendNumber<std::int32_t>},
                           {"|u1", 1, NumberAt<std::uint8_t>, AppendNumber<std::uint8_t>}};

const Type& TypeOf(const std::string& dtype, const std::string& name) {
  for (const Type& type : kTypes) {
    if (type.dtype == dtype) return type;
  }
  throw InvalidInput("{}: the numbers are of type '{}', wanted one of <f8, <f4, <i8, <i4, |u1", name, dtype);
}

/// How many numbers a shape holds, or nothing if that is more than can be.
std::optional<std::size_t> CountOf(const std::vector<std::size_t>& shape) {
  std::size_t count = 1;
  for (const std::size_t side : shape) {
    if (side != 0 && count > std::numeric_limits<std::size_t>::max() / sizeof(double) / side) return std::nullopt;
    count *= side;
  }
  return count;
}

/// The header's text; `bytes` is cut down to what follows it.
std::string_view TakeHeader(std::string_view& bytes, const std::string& name) {
  if (!bytes.starts_with(kMagic) || bytes.size() < kMagic.size() + 2) throw InvalidInput("{}: no .npy file", name);
  const int version = static_cast<unsigned char>(bytes[kMagic.size()]);
  if (version < 1 || version > 3) throw InvalidInput("{}: .npy format {}, wanted 1, 2 or 3", name, version);
  bytes.remove_prefix(kMagic.size() + 2);
  const std::size_t length_bytes = version == 1 ? 2 : 4;
  std::size_t length = 0;
  if (bytes.size() >= length_bytes) std::memcpy(&length, bytes.data(), length_bytes);
  if (bytes.size() < length_bytes || length > kMaxHeaderBytes || length > bytes.size() - length_bytes) {
    throw InvalidInput("{}: cut off within the .npy header", name);
  }
  const std::string_view text = bytes.substr(length_bytes, length);
  bytes.remove_prefix(length_bytes + length);
  return text;
}

/// Where the k-th number in C order stands in Fortran order (first index fastest).
std::size_t FortranIndex(std::size_t k, const std::vector<std::size_t>& shape) {
  std::size_t before = 1;
  for (const std::size_t side : shape) before *= side;
  std::size_t index = 0;
  for (auto side = shape.rbegin(); side != shape.rend(); ++side) {
    before /= *side;
    index += k % *side * before;
    k /= *side;
  }
  return index;
}

}  // namespace

NpyArray ParseNpy(std::string_view bytes, const std::string& name) {
  const std::string_view text = TakeHeader(bytes, name);
  Header header = HeaderParser(text, name).Parse();
  const Type& type = TypeOf(header.dtype, name);
  const std::optional<std::size_t> count = CountOf(header.shape);
  if (!count || *count != bytes.size() / type.bytes || bytes.size() % type.bytes != 0) {
    throw InvalidInput("{}: the shape ({}) of {} does not fit the {} bytes that follow the header", name,
                       fmt::join(header.shape, ", "), header.dtype, bytes.size());
  }
  NpyArray array{std::move(header.dtype), std::move(header.shape), {}};
  array.values.resize(*count);
  for (std::size_t k = 0; k < *count; ++k) {
    const std::size_t at = header.fortran_order ? FortranIndex(k, array.shape) : k;
    array.values[k] = type.read(bytes.data() + at * type.bytes);
  }
  return array;
}

NpyArray ReadNpy(const fs::path& path) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(path, error);
  if (!error && size > kMaxFileBytes)
    throw InvalidInput("{}: {} bytes, wanted at most {}", path.string(), size, kMaxFileBytes);
  return ParseNpy(ReadFile(path), path.string());
}

std::string NpyBytes(const NpyArray& array) {
  const Type& type = TypeOf(array.dtype, "array");
  if (CountOf(array.shape) != array.values.size()) {
    throw InvalidInput("array: {} numbers do not fill the shape ({})", array.values.size(),
                       fmt::join(array.shape, ", "));
  }
  std::string text = fmt::format("{{'descr': '{}', 'fortran_order': False, 'shape': ({}{}), }}", array.dtype,
                                 fmt::join(array.shape, ", "), array.shape.size() == 1 ? "," : "");
  const std::size_t before = kMagic.size() + 2 + 2;
  text.append(kAlignment - (before + text.size() + 1) % kAlignment, ' ');
  text += '\n';
  std::string bytes = std::string(kMagic) + std::string("\x01\x00", 2);
  bytes += {static_cast<char>(text.size() & 0xff), static_cast<char>(text.size() >> 8)};
  bytes += text;
  bytes.reserve(bytes.size() + array.values.size() * type.bytes);
  for (const double value : array.values) type.append(bytes, value);
  return bytes;
}

void WriteNpy(const fs::path& path, const NpyArray& array) { WriteFileAtomically(path, NpyBytes(array)); }

}  // namespace evac
