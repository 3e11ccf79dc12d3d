#include "core/tensor_file_pickle.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <string_view>

#include "core/tensor_file.h"

namespace evac {
namespace {

using Kind = PickleValue::Kind;
using Items = std::vector<std::uint32_t>;  // places in Pickle::values

constexpr std::size_t kMaxBytes = 64'000'000, kMaxValues = 4'000'000, kMaxMarks = 1000;

/// Names that stand for themselves: types of storages and numbers.
bool IsTypeName(std::string_view name) {
  static constexpr std::array<std::string_view, 19> kNames = {
      "FloatStorage", "HalfStorage", "BFloat16Storage", "DoubleStorage", "LongStorage", "IntStorage", "ShortStorage",
      "CharStorage",  "ByteStorage", "BoolStorage",     "float32",       "float16",     "bfloat16",   "float64",
      "int64",        "int32",       "int16",           "uint8",         "bool"};
  return name.starts_with("torch.") && std::find(kNames.begin(), kNames.end(), name.substr(6)) != kNames.end();
}

/// Callables that a checkpoint's pickle names, and what stands for their answer.
enum class Callable { kNone, kDict, kTensor, kFirst, kInert };
Callable CallableOf(std::string_view name) {
  if (name == "collections.OrderedDict") return Callable::kDict;
  if (name == "torch._utils._rebuild_tensor_v2") return Callable::kTensor;
  if (name == "torch._utils._rebuild_parameter" || name == "torch.jit._pickle.restore_type_tag")
    return Callable::kFirst;
  if (name == "torch.Size" || name == "torch.device" || name == "builtins.set" || name == "__builtin__.set")
    return Callable::kInert;
  return Callable::kNone;
}

class PickleReader {
 public:
  PickleReader(std::span<const std::byte> bytes, const std::string& file) : bytes_(bytes), file_(file) {}

  Pickle Read() {
    if (bytes_.size() > kMaxBytes) throw Broken("is longer than 64 MB");
    while (Step()) {
    }
    if (stack_.size() != 1) throw Broken("ends with " + std::to_string(stack_.size()) + " values, wanted one");
    pickle_.root = stack_.back();
    return std::move(pickle_);
  }

 private:
  TensorError Broken(const std::string& what) const {
    return TensorError(file_ + ": pickle, byte " + std::to_string(at_) + ": " + what);
  }

  template <typename T>
  T Take() {
    T value{};
    std::memcpy(&value, TakeBytes(sizeof value).data(), sizeof value);
    return value;
  }
  std::string_view TakeBytes(std::size_t count) {
    if (count > bytes_.size() - at_) throw Broken("cut off");
    const std::string_view taken(reinterpret_cast<const char*>(bytes_.data()) + at_, count);
    at_ += count;
    return taken;
  }
  std::string TakeLine() {
    const std::string_view rest(reinterpret_cast<const char*>(bytes_.data()) + at_, bytes_.size() - at_);
    const std::size_t length = rest.find('\n');
    if (length == std::string_view::npos) throw Broken("cut off");
    at_ += length + 1;
    return std::string(rest.substr(0, length));
  }

  void Push(PickleValue value) {
    if (pickle_.values.size() == kMaxValues) throw Broken("more than 4 million values");
    pickle_.values.push_back(std::move(value));
    stack_.push_back(static_cast<std::uint32_t>(pickle_.values.size() - 1));
  }
  void PushInt(std::int64_t number) { Push({Kind::kInt, number, {}, {}}); }
  void PushText(std::string_view text) { Push({Kind::kText, 0, std::string(text), {}}); }
  /// Takes the topmost `count` values: never below the last mark.
  Items Pop(std::size_t count) {
    const std::size_t floor = marks_.empty() ? 0 : marks_.back();
    if (stack_.size() - floor < count) throw Broken("takes more from its stack than there is");
    const Items popped(stack_.end() - static_cast<std::ptrdiff_t>(count), stack_.end());
    stack_.resize(stack_.size() - count);
    return popped;
  }
  std::uint32_t PopOne() { return Pop(1).front(); }
  Items PopToMark() {
    if (marks_.empty()) throw Broken("a mark is missing");
    Items popped = Pop(stack_.size() - marks_.back());
    marks_.pop_back();
    return popped;
  }
  PickleValue& Top(Kind kind, const char* what) {
    const std::size_t floor = marks_.empty() ? 0 : marks_.back();
    if (stack_.size() == floor || pickle_.values[stack_.back()].kind != kind)
      throw Broken(std::string("wanted a ") + what);
    return pickle_.values[stack_.back()];
  }
  void AddTo(Kind kind, const char* what, const Items& items) {
    if (kind == Kind::kDict && items.size() % 2 != 0) throw Broken("a key without a value");
    Items& all = Top(kind, what).items;
    all.insert(all.end(), items.begin(), items.end());
  }

  /// One opcode. @returns false at the end.
  bool Step() {
    const auto opcode = Take<std::uint8_t>();
    if (opcode == '.') return false;
    if (!Simple(opcode) && !Collection(opcode) && !Structure(opcode)) throw Refused(opcode);
    return true;
  }
  TensorError Refused(std::uint8_t opcode) const {
    static constexpr char kDigits[] = "0123456789abcdef";
    return Broken(std::string("opcode 0x") + kDigits[opcode >> 4] + kDigits[opcode & 15] +
                  " is none that torch.save writes: refused");
  }

  bool Simple(std::uint8_t opcode) {
    switch (opcode) {
      case 0x80:
        Protocol();
        return true;
      case 'N':
        Push({});
        return true;
      case 0x88:
        Push({Kind::kBool, 1, {}, {}});
        return true;
      case 0x89:
        Push({Kind::kBool, 0, {}, {}});
        return true;
      case 'J':
        PushInt(Take<std::int32_t>());
        return true;
      case 'K':
        PushInt(Take<std::uint8_t>());
        return true;
      case 'M':
        PushInt(Take<std::uint16_t>());
        return true;
      case 0x8a:
        PushLong();
        return true;
      case 'G':
        Take<std::uint64_t>();
        Push({Kind::kFloat, 0, {}, {}});
        return true;
      case 'X':
      case 'T':
        PushText(TakeBytes(Take<std::uint32_t>()));
        return true;
      case 'U':
        PushText(TakeBytes(Take<std::uint8_t>()));
        return true;
      default:
        return false;
    }
  }
  void Protocol() {
    const auto protocol = Take<std::uint8_t>();
    if (protocol != 2) throw Broken("protocol " + std::to_string(protocol) + ", wanted 2, torch.save's");
  }
  void PushLong() {
    const std::string_view digits = TakeBytes(Take<std::uint8_t>());
    if (digits.size() > 8) throw Broken("a whole number beyond 64 bits");
    std::uint64_t number = !digits.empty() && (digits.back() & 0x80) != 0 ? ~std::uint64_t{0} : 0;
    std::memcpy(&number, digits.data(), digits.size());
    PushInt(static_cast<std::int64_t>(number));
  }

  bool Collection(std::uint8_t opcode) {
    switch (opcode) {
      case '(':
        if (marks_.size() == kMaxMarks) throw Broken("nested deeper than 1000");
        marks_.push_back(stack_.size());
        return true;
      case ')':
        Push({Kind::kTuple, 0, {}, {}});
        return true;
      case 0x85:
      case 0x86:
      case 0x87:
        Push({Kind::kTuple, 0, {}, Pop(opcode - 0x84U)});
        return true;
      case 't':
        Push({Kind::kTuple, 0, {}, PopToMark()});
        return true;
      case ']':
        Push({Kind::kList, 0, {}, {}});
        return true;
      case 'a':
        AddTo(Kind::kList, "list", Items{PopOne()});
        return true;
      case 'e':
        AddTo(Kind::kList, "list", PopToMark());
        return true;
      case '}':
        Push({Kind::kDict, 0, {}, {}});
        return true;
      case 's':
        AddTo(Kind::kDict, "dict", Pop(2));
        return true;
      case 'u':
        AddTo(Kind::kDict, "dict", PopToMark());
        return true;
      default:
        return false;
    }
  }

  bool Structure(std::uint8_t opcode) {
    switch (opcode) {
      case 'q':
        Remember(Take<std::uint8_t>());
        return true;
      case 'r':
        Remember(Take<std::uint32_t>());
        return true;
      case 'h':
        Recall(Take<std::uint8_t>());
        return true;
      case 'j':
        Recall(Take<std::uint32_t>());
        return true;
      case 'c':
        Global();
        return true;
      case 'R':
        Reduce();
        return true;
      case 'b':
        Build();
        return true;
      case 'Q':
        PersistentId();
        return true;
      default:
        return false;
    }
  }
  void Remember(std::uint32_t place) {
    if (stack_.empty()) throw Broken("remembers nothing");
    memo_[place] = stack_.back();
  }
  void Recall(std::uint32_t place) {
    const auto found = memo_.find(place);
    if (found == memo_.end()) throw Broken("recalls what it never remembered");
    stack_.push_back(found->second);
    if (stack_.size() > kMaxValues) throw Broken("more than 4 million values");
  }
  void Global() {
    const std::string module = TakeLine(), name = module + "." + TakeLine();
    if (CallableOf(name) == Callable::kNone && !IsTypeName(name))
      throw Broken("names '" + name + "', which no checkpoint needs: refused, nothing was executed");
    Push({Kind::kGlobal, 0, name, {}});
  }
  void Reduce() {
    const Items both = Pop(2);
    const PickleValue &callable = pickle_.values[both[0]], &arguments = pickle_.values[both[1]];
    const Callable what = callable.kind == Kind::kGlobal ? CallableOf(callable.text) : Callable::kNone;
    if (what == Callable::kNone || arguments.kind != Kind::kTuple) throw Broken("calls what is no callable");
    const Items& given = arguments.items;
    if (what == Callable::kInert) return Push({Kind::kInert, 0, {}, {}});
    if (what == Callable::kDict && given.empty()) return Push({Kind::kDict, 0, {}, {}});
    if (what == Callable::kFirst && !given.empty()) return stack_.push_back(given[0]);
    if (what == Callable::kTensor && given.size() >= 4)
      return Push({Kind::kTensor, 0, {}, {given.begin(), given.begin() + 4}});
    throw Broken("'" + callable.text + "' has other arguments than torch.save writes");
  }
  /// An OrderedDict carries attributes (`_metadata`), which are of no use here.
  void Build() {
    PopOne();
    Top(Kind::kDict, "dict to put attributes on");
  }
  void PersistentId() {
    const PickleValue& id = pickle_.values[PopOne()];
    if (id.kind != Kind::kTuple || id.items.size() != 5 || pickle_.values[id.items[0]].text != "storage")
      throw Broken("a persistent id that is no storage");
    Push({Kind::kStorage, 0, {}, {id.items.begin() + 1, id.items.end()}});
  }

  std::span<const std::byte> bytes_;
  const std::string& file_;
  std::size_t at_ = 0;
  Pickle pickle_;
  Items stack_;
  std::vector<std::size_t> marks_;
  std::map<std::uint32_t, std::uint32_t> memo_;
};

}  // namespace

Pickle ReadPickle(std::span<const std::byte> bytes, const std::string& file) {
  return PickleReader(bytes, file).Read();
}

}  // namespace evac
