#include "core/tensor_file_header.h"

#include <array>
#include <charconv>
#include <set>

namespace evac {
namespace {

struct TypeRow {
  TensorType type;
  const char* name;
  std::size_t bytes;
};
constexpr std::array<TypeRow, 10> kTypes = {{{TensorType::kBool, "BOOL", 1},
                                             {TensorType::kU8, "U8", 1},
                                             {TensorType::kI8, "I8", 1},
                                             {TensorType::kI16, "I16", 2},
                                             {TensorType::kI32, "I32", 4},
                                             {TensorType::kI64, "I64", 8},
                                             {TensorType::kF16, "F16", 2},
                                             {TensorType::kBF16, "BF16", 2},
                                             {TensorType::kF32, "F32", 4},
                                             {TensorType::kF64, "F64", 8}}};
constexpr std::size_t kMaxDimensions = 16;
constexpr std::size_t kMaxBytes = std::size_t{1} << 62;

void AppendUtf8(std::string& text, std::uint32_t code) {
  if (code < 0x80) {
    text += static_cast<char>(code);
  } else if (code < 0x800) {
    text += static_cast<char>(0xc0 | code >> 6);
    text += static_cast<char>(0x80 | (code & 0x3f));
  } else if (code < 0x10000) {
    text += static_cast<char>(0xe0 | code >> 12);
    text += static_cast<char>(0x80 | (code >> 6 & 0x3f));
    text += static_cast<char>(0x80 | (code & 0x3f));
  } else {
    text += static_cast<char>(0xf0 | code >> 18);
    text += static_cast<char>(0x80 | (code >> 12 & 0x3f));
    text += static_cast<char>(0x80 | (code >> 6 & 0x3f));
    text += static_cast<char>(0x80 | (code & 0x3f));
  }
}

/// A reader for the one shape of JSON that a header has: {"name": {"dtype": "F32", "shape": [2], "data_offsets": [0,
/// 8]}}.
class HeaderReader {
 public:
  HeaderReader(std::string_view text, const std::string& file) : all_(text), text_(text), file_(file) {}

  TensorHeader Read() {
    TensorHeader header;
    std::set<std::string> seen;
    Members([&](const std::string& name) {
      if (!seen.insert(name).second) throw Broken("'" + name + "' is there twice");
      if (name == "__metadata__") {
        header.metadata = Metadata();
      } else {
        header.entries.push_back(Entry(name));
      }
    });
    SkipSpace();
    if (!text_.empty()) throw Broken("something follows the closing brace");
    return header;
  }

 private:
  TensorError Broken(const std::string& what) const {
    return TensorError(file_ + ": safetensors header, byte " + std::to_string(all_.size() - text_.size()) + ": " +
                       what);
  }
  void SkipSpace() {
    while (!text_.empty() && std::string_view(" \t\r\n").find(text_.front()) != std::string_view::npos)
      text_.remove_prefix(1);
  }
  bool Accept(char wanted) {
    SkipSpace();
    if (text_.empty() || text_.front() != wanted) return false;
    text_.remove_prefix(1);
    return true;
  }
  void Expect(char wanted) {
    if (!Accept(wanted)) throw Broken(std::string("wanted '") + wanted + "'");
  }
  /// {"key": value, …}: `member` reads the value.
  template <typename Function>
  void Members(Function member) {
    Expect('{');
    if (Accept('}')) return;
    do {
      const std::string key = String();
      Expect(':');
      member(key);
    } while (Accept(','));
    Expect('}');
  }
  std::uint32_t Hex4() {
    std::uint32_t code = 0;
    const char* end = text_.data() + (text_.size() < 4 ? text_.size() : 4);
    const auto [at, error] = std::from_chars(text_.data(), end, code, 16);
    if (error != std::errc() || at != text_.data() + 4) throw Broken("wanted four hexadecimal digits");
    text_.remove_prefix(4);
    return code;
  }
  void Escape(std::string& value) {
    static constexpr std::string_view kFrom = "\"\\/bfnrt", kTo = "\"\\/\b\f\n\r\t";
    if (text_.empty()) throw Broken("cut off in a string");
    const char what = text_.front();
    text_.remove_prefix(1);
    if (const std::size_t at = kFrom.find(what); at != std::string_view::npos) {
      value += kTo[at];
      return;
    }
    if (what != 'u') throw Broken("an unknown escape in a string");
    std::uint32_t code = Hex4();
    if (code >= 0xdc00 && code < 0xe000) throw Broken("half a surrogate pair");
    if (code >= 0xd800 && code < 0xdc00) {
      if (!text_.starts_with("\\u")) throw Broken("half a surrogate pair");
      text_.remove_prefix(2);
      const std::uint32_t low = Hex4();
      if (low < 0xdc00 || low >= 0xe000) throw Broken("half a surrogate pair");
      code = 0x10000 + ((code - 0xd800) << 10) + (low - 0xdc00);
    }
    AppendUtf8(value, code);
  }
  std::string String() {
    Expect('"');
    std::string value;
    while (true) {
      if (text_.empty()) throw Broken("cut off in a string");
      const char next = text_.front();
      text_.remove_prefix(1);
      if (next == '"') return value;
      if (static_cast<unsigned char>(next) < 0x20) throw Broken("a control character in a string");
      if (next == '\\') {
        Escape(value);
      } else {
        value += next;
      }
    }
  }
  std::int64_t Number() {
    SkipSpace();
    std::int64_t value = 0;
    const auto [end, error] = std::from_chars(text_.data(), text_.data() + text_.size(), value);
    if (error != std::errc() || value < 0) throw Broken("wanted a whole number from 0 to 2^63 - 1");
    text_.remove_prefix(static_cast<std::size_t>(end - text_.data()));
    return value;
  }
  std::vector<std::int64_t> Numbers(std::size_t at_most) {
    std::vector<std::int64_t> values;
    Expect('[');
    if (Accept(']')) return values;
    do {
      if (values.size() == at_most) throw Broken("more than " + std::to_string(at_most) + " numbers");
      values.push_back(Number());
    } while (Accept(','));
    Expect(']');
    return values;
  }
  TensorMetadata Metadata() {
    TensorMetadata metadata;
    Members([&](const std::string& key) {
      if (!metadata.emplace(key, String()).second) throw Broken("metadata '" + key + "' is there twice");
    });
    return metadata;
  }
  TensorType Type() {
    const std::string name = String();
    for (const TypeRow& row : kTypes) {
      if (name == row.name) return row.type;
    }
    throw Broken("unknown dtype '" + name + "'");
  }
  HeaderEntry Entry(const std::string& name) {
    HeaderEntry entry;
    entry.name = name;
    std::set<std::string> seen;
    Members([&](const std::string& field) {
      if (!seen.insert(field).second) throw Broken("'" + name + "' has '" + field + "' twice");
      if (field == "dtype") {
        entry.type = Type();
      } else if (field == "shape") {
        entry.shape = Numbers(kMaxDimensions);
      } else if (field == "data_offsets") {
        const std::vector<std::int64_t> offsets = Numbers(2);
        if (offsets.size() != 2) throw Broken("'" + name + "': wanted two data_offsets");
        entry.begin = static_cast<std::size_t>(offsets[0]);
        entry.end = static_cast<std::size_t>(offsets[1]);
      } else {
        throw Broken("'" + name + "': unknown field '" + field + "'");
      }
    });
    if (seen.size() != 3) throw Broken("'" + name + "': wanted dtype, shape and data_offsets");
    return entry;
  }

  std::string_view all_, text_;
  const std::string& file_;
};

std::string Quoted(const std::string& text) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += {'\\', c};
    } else if (static_cast<unsigned char>(c) < 0x20) {
      quoted += {'\\', 'u', '0', '0', kDigits[c >> 4], kDigits[c & 15]};
    } else {
      quoted += c;
    }
  }
  return quoted + "\"";
}

}  // namespace

std::size_t BytesOf(TensorType type) { return kTypes[static_cast<std::size_t>(type)].bytes; }
const char* Name(TensorType type) { return kTypes[static_cast<std::size_t>(type)].name; }

std::size_t TensorDeclaration::ByteCount() const {
  std::size_t count = BytesOf(type);
  bool is_empty = false;
  for (const std::int64_t side : shape) {
    if (side < 0) throw TensorError("tensor '" + name + "': a negative size");
    if (side == 0) is_empty = true;
    if (side != 0 && count > kMaxBytes / static_cast<std::size_t>(side))
      throw TensorError("tensor '" + name + "': its shape is beyond any memory");
    if (side != 0) count *= static_cast<std::size_t>(side);
  }
  return is_empty ? 0 : count;
}

TensorHeader ParseTensorHeader(std::string_view text, const std::string& file) {
  return HeaderReader(text, file).Read();
}

std::string TensorHeaderText(std::span<const TensorDeclaration> tensors, const TensorMetadata& metadata) {
  std::string text = "{";
  if (!metadata.empty()) {
    text += "\"__metadata__\":{";
    for (const auto& [key, value] : metadata) text += Quoted(key) + ":" + Quoted(value) + ",";
    text.back() = '}';
  }
  std::size_t at = 0;
  for (const TensorDeclaration& tensor : tensors) {
    if (text.size() > 1) text += ',';
    text += Quoted(tensor.name) + ":{\"dtype\":\"" + Name(tensor.type) + "\",\"shape\":[";
    for (std::size_t i = 0; i < tensor.shape.size(); ++i) text += (i ? "," : "") + std::to_string(tensor.shape[i]);
    const std::size_t end = at + tensor.ByteCount();
    text += "],\"data_offsets\":[" + std::to_string(at) + "," + std::to_string(end) + "]}";
    at = end;
  }
  text += "}";
  text.append((8 - text.size() % 8) % 8, ' ');
  return text;
}

}  // namespace evac
