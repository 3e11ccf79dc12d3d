#include "core/config.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdint>
#include <set>
#include <sstream>
#include <type_traits>

#include "core/file.h"
#include "core/hash.h"
#include "core/utf8.h"

namespace evac {
namespace {

int EditDistance(const std::string& a, const std::string& b) {
  std::vector<int> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = static_cast<int>(j);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    int diagonal = row[0];
    row[0] = static_cast<int>(i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const int above = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, diagonal + (a[i - 1] != b[j - 1])});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::string Shown(const YAML::Node& node) {
  if (!node.IsDefined() || node.IsNull()) return "nothing";
  if (node.IsMap()) return "a mapping";
  if (node.IsSequence()) return "a list";
  return "'" + node.Scalar() + "'";
}

template <typename T>
const char* kTypeName = "a value";
template <>
const char* kTypeName<bool> = "true or false";
template <>
const char* kTypeName<int> = "a whole number";
template <>
const char* kTypeName<std::uint64_t> = "a whole number, 0 or more";
template <>
const char* kTypeName<double> = "a number";
template <>
const char* kTypeName<std::string> = "a text";
template <>
const char* kTypeName<std::vector<double>> = "a list of numbers";
template <>
const char* kTypeName<std::vector<std::string>> = "a list of texts";
template <>
const char* kTypeName<std::vector<std::uint64_t>> = "a list of whole numbers, 0 or more";

/// One line, whatever is in it.
std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    if (c == '\n') {
      escaped += "\\n";
    } else {
      if (c == '\\') escaped += c;
      escaped += c;
    }
  }
  return escaped;
}

/// Sorted keys, one line a scalar: what two files with the same content agree on.
void WriteCanonical(const YAML::Node& node, const std::string& field, std::ostringstream& out) {
  if (node.IsMap()) {
    std::vector<std::string> keys;
    for (const auto& item : node) keys.push_back(item.first.Scalar());
    std::sort(keys.begin(), keys.end());
    for (const std::string& key : keys) WriteCanonical(node[key], field + "." + Escaped(key), out);
    if (keys.empty()) out << field << "={}\n";
  } else if (node.IsSequence()) {
    for (std::size_t i = 0; i < node.size(); ++i) WriteCanonical(node[i], field + "." + std::to_string(i), out);
    if (node.size() == 0) out << field << "=[]\n";
  } else {
    out << field << "=" << (node.IsScalar() ? Escaped(node.Scalar()) : "~") << "\n";
  }
}

/// The YAML library would replace other bytes when it writes: the stored page would not be the page that was read.
void DemandUtf8(const std::string& text, const std::filesystem::path& file) {
  const std::size_t good = Utf8Prefix(text);
  if (good == text.size()) return;
  throw InvalidInput("{}:{}: found the byte 0x{:02x}, wanted UTF-8 text", file.string(),
                     1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(good), '\n'),
                     static_cast<unsigned char>(text[good]));
}

/// Whether a line is a document's begin ("---") or end ("..."): these stand so at the first letter and nowhere else.
bool IsMarker(const std::string& line, const char* marker) {
  return line.starts_with(marker) && (line.size() == 3 || std::isspace(static_cast<unsigned char>(line[3])));
}

/// The library reads the first of several documents and is silent about the others.
void DemandOneDocument(const std::string& text, const std::filesystem::path& file) {
  std::istringstream lines(text);
  bool has_content = false, has_ended = false;
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    const bool begins = IsMarker(line, "---"), ends = IsMarker(line, "...");
    const std::size_t word = line.find_first_not_of(" \t\r", begins || ends ? 3 : 0);
    const bool says = word != std::string::npos && line[word] != '#' && line[word] != '%';
    if (has_content && (begins || (has_ended && says)))
      throw InvalidInput("{}:{}: found a second document, wanted one", file.string(), number);
    has_content = has_content || says;
    has_ended = has_ended || ends;
  }
}

/// An escape ("\_") may stand for such bytes too. And the library writes a carriage return as it is, but reads it as a
/// part of the line's end where a line feed follows.
void DemandWritable(const YAML::Node& scalar, const std::filesystem::path& file) {
  if (!scalar.IsScalar()) return;
  if (Utf8Prefix(scalar.Scalar()) != scalar.Scalar().size())
    throw InvalidInput("{}:{}: an escape stands for bytes that are no UTF-8", file.string(), scalar.Mark().line + 1);
  if (scalar.Scalar().find('\r') != std::string::npos)
    throw InvalidInput("{}:{}: found a carriage return in a value, wanted none: lines end in \\n or \\r\\n",
                       file.string(), scalar.Mark().line + 1);
}

constexpr int kMaxDepth = 100, kMaxValues = 250'000;
constexpr std::size_t kMaxBytes = std::size_t{64} << 20;

/// Where the check of a page stands. A value that is named within itself ("a: &x [*x]") has no end, and ten lines of
/// aliases stand for more values than anybody waits for, or one long text of them for more bytes.
struct Walk {
  const std::filesystem::path& file;
  int depth = 0, values = 0;
  std::size_t above = 0, bytes = 0;  ///< of the keys that lead here; of all values, each with those (see WriteCanonical)
};

void DemandBounded(const YAML::Node& node, Walk& walk) {
  if (walk.depth > kMaxDepth || ++walk.values > kMaxValues)
    throw InvalidInput("{}:{}: found more than {} values, or some more than {} deep: an alias within what it names?",
                       walk.file.string(), node.Mark().line + 1, kMaxValues, kMaxDepth);
  walk.bytes += walk.above + (node.IsScalar() ? node.Scalar().size() : 0);
  if (walk.bytes > kMaxBytes)
    throw InvalidInput("{}:{}: found more than {} MB of values: a long text that many aliases name?",
                       walk.file.string(), node.Mark().line + 1, kMaxBytes >> 20);
}

/// YAML allows keys that are lists; its parser lets the first of two equal keys win. Neither can be meant.
void DemandPlain(const YAML::Node& node, Walk& walk) {
  const std::filesystem::path& file = walk.file;
  DemandBounded(node, walk);
  std::set<std::string> keys;
  DemandWritable(node, file);
  ++walk.depth;
  for (const auto& item : node) {
    if (!node.IsMap()) {
      DemandPlain(item, walk);
      continue;
    }
    const int line = item.first.Mark().line + 1;
    if (!item.first.IsScalar())
      throw InvalidInput("{}:{}: found {} as a key, wanted a text", file.string(), line, Shown(item.first));
    DemandWritable(item.first, file);
    if (!keys.insert(item.first.Scalar()).second)
      throw InvalidInput("{}:{}: field {} is given twice", file.string(), line, item.first.Scalar());
    walk.above += item.first.Scalar().size();
    DemandPlain(item.second, walk);
    walk.above -= item.first.Scalar().size();
  }
  --walk.depth;
}

void DemandPlain(const YAML::Node& node, const std::filesystem::path& file) {
  Walk walk{file};
  DemandPlain(node, walk);
}

YAML::Node Parse(const std::string& text, const std::filesystem::path& file) {
  DemandUtf8(text, file);
  DemandOneDocument(text, file);
  try {
    YAML::Node node = YAML::Load(text);
    if (!node.IsMap())
      throw InvalidInput("{}: found {}, wanted a YAML mapping (key: value)", file.string(), Shown(node));
    DemandPlain(node, file);
    return node;
  } catch (const YAML::Exception& error) {
    throw InvalidInput("{}:{}: not YAML: {}", file.string(), error.mark.line + 1, error.msg);
  }
}

/// YAML has .inf and .nan; no field of ours does.
template <typename T>
bool IsFinite(const T& value) {
  if constexpr (std::is_same_v<T, double>) return std::isfinite(value);
  if constexpr (std::is_same_v<T, std::vector<double>>)
    return std::all_of(value.begin(), value.end(), [](double x) { return std::isfinite(x); });
  return true;
}

YAML::Node Step(const YAML::Node& node, const std::string& key) {
  if (node.IsMap()) return node[key];
  const bool is_index = !key.empty() && key.size() < 7 &&
                        std::all_of(key.begin(), key.end(), [](unsigned char c) { return std::isdigit(c); });
  if (node.IsSequence() && is_index && std::stoul(key) < node.size()) return node[std::stoul(key)];
  return YAML::Node(YAML::NodeType::Undefined);
}

/// The fields below `field` that are that very node: several where aliases name it, or what it lies in.
void AddPlaces(const YAML::Node& wanted, const YAML::Node& node, const std::string& field,
               std::vector<std::string>& places) {
  if (node.is(wanted)) places.push_back(field);
  const std::string above = field.empty() ? "" : field + ".";
  if (node.IsMap()) {
    for (const auto& item : node) AddPlaces(wanted, item.second, above + item.first.Scalar(), places);
  } else if (node.IsSequence()) {
    for (std::size_t i = 0; i < node.size(); ++i) AddPlaces(wanted, node[i], above + std::to_string(i), places);
  }
}

/// The library keeps one node for all that name it: what is written to one is written to all.
void DemandOnePlace(const YAML::Node& wanted, const YAML::Node& page, const std::string& assignment,
                    const std::filesystem::path& file) {
  std::vector<std::string> places;
  AddPlaces(wanted, page, "", places);
  if (places.size() > 1)
    throw InvalidInput("--set {}: in {} fields {} and {} are one, by an alias (*): wanted each written out", assignment,
                       file.string(), places[0], places[1]);
}

}  // namespace

Config::Config(YAML::Node node, std::filesystem::path file, std::string field)
    : node_(std::move(node)), file_(std::move(file)), field_(std::move(field)) {}

Config Config::FromFile(const std::filesystem::path& path) { return FromText(ReadFile(path), path); }

Config Config::FromText(const std::string& text, const std::filesystem::path& name) {
  return Config(Parse(text, name), name, "");
}

void Config::Set(const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  const bool has_nameless = ("." + assignment.substr(0, equals) + ".").find("..") != std::string::npos;
  if (equals == std::string::npos || has_nameless)
    throw InvalidInput("--set {}: wanted path.to.field=VALUE", assignment);
  DemandUtf8(assignment, std::filesystem::path("--set"));
  std::vector<std::string> keys;
  std::istringstream path(assignment.substr(0, equals));
  for (std::string key; std::getline(path, key, '.');) keys.push_back(key);

  YAML::Node parent = node_;  // reset, never assigned: assignment would write into the tree
  std::size_t depth = 0;      // of the first key that is not there, or of the last one
  for (; depth + 1 < keys.size(); ++depth) {
    const YAML::Node next = Step(parent, keys[depth]);
    if (!next.IsDefined() || next.IsNull()) break;
    parent.reset(next);
  }
  YAML::Node value;
  try {
    value = YAML::Load(assignment.substr(equals + 1));
  } catch (const YAML::Exception& error) {
    throw InvalidInput("--set {}: the value is not YAML: {}", assignment, error.msg);
  }
  for (std::size_t i = keys.size() - 1; i > depth; --i) {  // sections that are not there are made
    YAML::Node section(YAML::NodeType::Map);
    section[keys[i]] = value;
    value.reset(section);
  }
  DemandPlain(value, "--set " + assignment);
  YAML::Node item = Step(parent, keys[depth]);
  DemandOnePlace(item.IsDefined() ? item : parent, node_, assignment, file_);
  if (parent.IsMap()) {
    parent[keys[depth]] = value;
    return;
  }
  if (!item.IsDefined())
    throw InvalidInput("--set {}: {} has no field or item '{}'", assignment, file_.string(), keys[depth]);
  item = value;
}

YAML::Node Config::Child(const std::string& key) const {
  return node_.IsMap() ? node_[key] : YAML::Node(YAML::NodeType::Undefined);
}

std::string Config::FieldName(const std::string& key) const {
  if (key.empty()) return field_;
  return field_.empty() ? key : field_ + "." + key;
}

std::string Config::Where(const std::string& key) const {
  const YAML::Node child = key.empty() ? node_ : Child(key);
  const YAML::Mark mark = child.IsDefined() ? child.Mark() : node_.Mark();
  const std::string field = FieldName(key);
  // Only the whole page begins at the first letter; a field that does is a text of its own, from --set, and one that
  // begins nowhere a section that was made for it.
  const bool is_page = child.IsDefined() ? field.empty() : field_.empty();
  const std::string line = mark.pos <= 0 && !is_page ? " (--set)" : fmt::format(":{}", mark.line + 1);
  return fmt::format("{}{}{}", file_.string(), line, field.empty() ? "" : ": field " + field);
}

bool Config::Has(const std::string& key) const {
  const YAML::Node child = Child(key);
  return child.IsDefined() && !child.IsNull();
}

void Config::ThrowWrongType(const std::string& key, const YAML::Node& found, const char* wanted) const {
  throw InvalidInput("{}: found {}, wanted {}", Where(key), Shown(found), wanted);
}

template <typename T>
T Config::Converted(const std::string& key, const YAML::Node& node) const {
  try {
    const T value = node.as<T>();
    if (IsFinite(value)) return value;
  } catch (const YAML::Exception&) {  // told below
  }
  ThrowWrongType(key, node, kTypeName<T>);
}

template <typename T>
T Config::Get(const std::string& key) const {
  const YAML::Node child = Child(key);
  if (!child.IsDefined() || child.IsNull()) ThrowWrongType(key, child, kTypeName<T>);
  return Converted<T>(key, child);
}

template <typename T>
T Config::Get(const std::string& key, const T& otherwise) const {
  return Has(key) ? Get<T>(key) : otherwise;
}

template <typename T>
T Config::Value() const {
  return Converted<T>("", node_);
}

#define EVAC_CONFIG_TYPE(T)                                      \
  template T Config::Get<T>(const std::string&) const;           \
  template T Config::Get<T>(const std::string&, const T&) const; \
  template T Config::Value<T>() const;
EVAC_CONFIG_TYPE(bool)
EVAC_CONFIG_TYPE(int)
EVAC_CONFIG_TYPE(double)
EVAC_CONFIG_TYPE(std::uint64_t)
EVAC_CONFIG_TYPE(std::string)
EVAC_CONFIG_TYPE(std::vector<double>)
EVAC_CONFIG_TYPE(std::vector<std::uint64_t>)
EVAC_CONFIG_TYPE(std::vector<std::string>)
#undef EVAC_CONFIG_TYPE

Config Config::Section(const std::string& key) const {
  const YAML::Node child = Child(key);
  if (!child.IsDefined() || !child.IsMap()) ThrowWrongType(key, child, "a mapping (key: value)");
  return Config(child, file_, FieldName(key));
}

std::vector<Config> Config::List(const std::string& key) const {
  const YAML::Node child = Child(key);
  std::vector<Config> items;
  if (!child.IsDefined() || child.IsNull()) return items;
  if (!child.IsSequence()) ThrowWrongType(key, child, "a list");
  for (std::size_t i = 0; i < child.size(); ++i)
    items.push_back(Config(child[i], file_, FieldName(key) + "." + std::to_string(i)));
  return items;
}

std::vector<std::string> Config::Keys() const {
  std::vector<std::string> keys;
  if (!node_.IsMap()) return keys;
  for (const auto& item : node_) keys.push_back(item.first.Scalar());
  return keys;
}

std::filesystem::path Config::Path(const std::string& key) const {
  const std::filesystem::path path = Get<std::string>(key);
  return path.is_absolute() ? path : file_.parent_path() / path;
}

void Config::AllowOnly(std::span<const char* const> known) const {
  for (const std::string& key : Keys()) {
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    if (known.empty()) throw InvalidInput("{}: there is no such field", Where(key));
    const auto nearest = std::min_element(known.begin(), known.end(), [&](const char* a, const char* b) {
      return EditDistance(key, a) < EditDistance(key, b);
    });
    throw InvalidInput("{}: there is no such field; the nearest is '{}'", Where(key), *nearest);
  }
}

void Config::Require(bool holds, const std::string& key, const std::string& wanted) const {
  if (!holds) throw InvalidInput("{}: found {}, wanted {}", Where(key), Shown(Child(key)), wanted);
}

std::string Config::ContentHash() const { return Sha256Hex(Canonical()); }

std::string Config::Text() const { return YAML::Dump(node_) + "\n"; }

std::string Config::Canonical() const {
  std::ostringstream out;
  WriteCanonical(node_, "", out);
  return std::move(out).str();
}

}  // namespace evac
