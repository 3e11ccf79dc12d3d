#include <sys/mman.h>

#include <algorithm>
#include <cstring>
#include <map>
#include <set>
#include <string_view>
#include <utility>

#include "core/tensor_file.h"
#include "core/tensor_file_pickle.h"
#include "core/tensor_file_zip.h"

namespace evac {
namespace {

using Kind = PickleValue::Kind;

constexpr std::size_t kMaxDimensions = 16, kMaxNameBytes = 1024;
constexpr std::string_view kZip = "PK\x03\x04", kDeepSpeedPrefix = "_forward_module.";

struct StorageType {
  const char* name;
  TensorType type;
};
constexpr StorageType kStorageTypes[] = {
    {"torch.FloatStorage", TensorType::kF32},     {"torch.HalfStorage", TensorType::kF16},
    {"torch.BFloat16Storage", TensorType::kBF16}, {"torch.DoubleStorage", TensorType::kF64},
    {"torch.LongStorage", TensorType::kI64},      {"torch.IntStorage", TensorType::kI32},
    {"torch.ShortStorage", TensorType::kI16},     {"torch.CharStorage", TensorType::kI8},
    {"torch.ByteStorage", TensorType::kU8},       {"torch.BoolStorage", TensorType::kBool}};

/// A tensor as the pickle describes it: elements `offset + Σ index · stride` of a storage.
struct Strided : TensorDeclaration {
  std::span<const std::byte> storage;
  std::size_t offset = 0;
  std::vector<std::size_t> strides;
};

class TorchReader {
 public:
  TorchReader(std::span<const std::byte> file, const std::string& name) : name_(name) {
    for (ZipEntry& entry : ReadZip(file, name)) entries_.emplace(std::move(entry.name), entry.bytes);
    FindPickle();
    pickle_ = ReadPickle(entries_.at(prefix_ + "data.pkl"), name_);
  }

  const std::string& layout() const { return layout_; }
  std::vector<Strided> Tensors() {
    const PickleValue& dict = ChooseDict();
    std::vector<Strided> tensors;
    std::set<std::string_view> names;  // a pickle may recall a long key a thousand times, and each would be copied
    for (std::size_t i = 0; i + 1 < dict.items.size(); i += 2) {
      const PickleValue &key = Value(dict.items[i]), &value = Value(dict.items[i + 1]);
      if (key.kind != Kind::kText) throw Broken("a key that is no text");
      if (key.text.size() > kMaxNameBytes)
        throw Broken("a key of " + std::to_string(key.text.size()) + " bytes, wanted at most " +
                     std::to_string(kMaxNameBytes));
      if (!names.insert(key.text).second) throw Broken("tensor '" + key.text + "' is there twice");
      if (value.kind != Kind::kTensor)
        throw Broken("'" + key.text +
                     "' is no tensor; wanted a dict of tensors, or one under 'state_dict' or 'module'");
      tensors.push_back(ReadTensor(key.text, value));
    }
    return tensors;
  }

 private:
  TensorError Broken(const std::string& what) const { return TensorError(name_ + ": " + what); }
  const PickleValue& Value(std::uint32_t place) const { return pickle_.values[place]; }

  void FindPickle() {
    static constexpr std::string_view kPickle = "data.pkl";
    int found = 0;
    for (const auto& [name, bytes] : entries_) {
      if (!name.ends_with(kPickle) || (name.size() > kPickle.size() && name[name.size() - kPickle.size() - 1] != '/'))
        continue;
      prefix_ = name.substr(0, name.size() - kPickle.size());
      ++found;
    }
    if (found != 1) throw Broken("a zip with " + std::to_string(found) + " files data.pkl, wanted one: no checkpoint");
    const auto order = entries_.find(prefix_ + "byteorder");
    if (order != entries_.end() && TextOf(order->second) != "little")
      throw Broken("its numbers are '" + TextOf(order->second) + "'-endian, wanted 'little'");
  }
  static std::string TextOf(std::span<const std::byte> bytes) {
    return {reinterpret_cast<const char*>(bytes.data()), std::min<std::size_t>(bytes.size(), 16)};
  }

  const PickleValue* Find(const PickleValue& dict, std::string_view wanted) const {
    for (std::size_t i = 0; i + 1 < dict.items.size(); i += 2) {
      const PickleValue &key = Value(dict.items[i]), &value = Value(dict.items[i + 1]);
      if (key.kind == Kind::kText && key.text == wanted && value.kind == Kind::kDict) return &value;
    }
    return nullptr;
  }
  const PickleValue& ChooseDict() {
    const PickleValue& root = Value(pickle_.root);
    if (root.kind != Kind::kDict) throw Broken("its pickle is no dict");
    if (const PickleValue* lightning = Find(root, "state_dict")) {
      layout_ = "state_dict";
      return *lightning;
    }
    if (const PickleValue* deep_speed = Find(root, "module")) {
      layout_ = "module";
      return *deep_speed;
    }
    return root;
  }

  Strided ReadTensor(const std::string& key, const PickleValue& value) const {
    const PickleValue &storage = Value(value.items[0]), &shape = Value(value.items[2]),
                      &strides = Value(value.items[3]);
    if (storage.kind != Kind::kStorage) throw Broken("'" + key + "' has no storage");
    Strided tensor;
    const bool strip = layout_ == "module" && key.starts_with(kDeepSpeedPrefix);
    tensor.name = strip ? key.substr(kDeepSpeedPrefix.size()) : key;
    tensor.type = TypeOf(key, Value(storage.items[0]));
    tensor.storage = StorageOf(key, storage, evac::BytesOf(tensor.type));
    tensor.offset = Number(key, Value(value.items[1]));
    for (const std::size_t side : Numbers(key, shape)) tensor.shape.push_back(static_cast<std::int64_t>(side));
    tensor.strides = Numbers(key, strides);
    CheckExtent(tensor);
    return tensor;
  }
  TensorType TypeOf(const std::string& key, const PickleValue& type) const {
    for (const StorageType& row : kStorageTypes) {
      if (type.kind == Kind::kGlobal && type.text == row.name) return row.type;
    }
    throw Broken("'" + key + "' has a storage of no known type");
  }
  std::span<const std::byte> StorageOf(const std::string& key, const PickleValue& storage, std::size_t width) const {
    const PickleValue& place = Value(storage.items[1]);
    const std::size_t count = Number(key, Value(storage.items[3]));
    const auto found = entries_.find(prefix_ + "data/" + place.text);
    if (place.kind != Kind::kText || found == entries_.end())
      throw Broken("'" + key + "' lies in storage '" + place.text + "', which is not there");
    if (count > found->second.size() / width || count * width != found->second.size())
      throw Broken("'" + key + "': storage '" + place.text + "' claims " + std::to_string(count) + " numbers of " +
                   std::to_string(width) + " bytes, and has " + std::to_string(found->second.size()) + " bytes");
    return found->second;
  }
  std::size_t Number(const std::string& key, const PickleValue& value) const {
    if (value.kind != Kind::kInt || value.number < 0) throw Broken("'" + key + "': wanted whole numbers from 0");
    return static_cast<std::size_t>(value.number);
  }
  std::vector<std::size_t> Numbers(const std::string& key, const PickleValue& tuple) const {
    if (tuple.kind != Kind::kTuple || tuple.items.size() > kMaxDimensions)
      throw Broken("'" + key + "': wanted at most " + std::to_string(kMaxDimensions) + " sides");
    std::vector<std::size_t> numbers;
    for (const std::uint32_t place : tuple.items) numbers.push_back(Number(key, Value(place)));
    return numbers;
  }
  /// The last element lies within the storage, and the tensor is not larger than it (nothing is there twice).
  void CheckExtent(const Strided& tensor) const {
    if (tensor.strides.size() != tensor.shape.size())
      throw Broken("'" + tensor.name + "' has a stride too many or few");
    const std::size_t count = tensor.storage.size() / evac::BytesOf(tensor.type);
    const TensorError outside = Broken("'" + tensor.name + "' is larger than its storage or reaches beyond it");
    if (tensor.offset > count) throw outside;
    if (std::find(tensor.shape.begin(), tensor.shape.end(), 0) != tensor.shape.end()) return;
    std::size_t last = tensor.offset, elements = 1;
    for (std::size_t i = 0; i < tensor.shape.size(); ++i) {
      const auto steps = static_cast<std::size_t>(tensor.shape[i]) - 1;
      if (steps >= count || (steps > 0 && tensor.strides[i] > count / steps)) throw outside;
      if (elements > count / (steps + 1)) throw outside;
      elements *= steps + 1;
      last += steps * tensor.strides[i];
      if (last >= count) throw outside;
    }
    if (last >= count) throw outside;
  }

  const std::string& name_;
  std::map<std::string, std::span<const std::byte>> entries_;
  std::string prefix_;  ///< "archive/"
  std::string layout_;
  Pickle pickle_;
};

bool IsRowByRow(const Strided& tensor) {
  std::size_t wanted = 1;
  for (std::size_t i = tensor.shape.size(); i-- > 0;) {
    if (tensor.shape[i] != 1 && tensor.strides[i] != wanted) return false;
    wanted *= static_cast<std::size_t>(tensor.shape[i]);
  }
  return true;
}

std::vector<std::byte> RowByRow(const Strided& tensor) {
  const std::size_t width = BytesOf(tensor.type), sides = tensor.shape.size();
  std::vector<std::byte> bytes(tensor.ByteCount());
  std::vector<std::int64_t> index(sides, 0);
  for (std::size_t to = 0; to < bytes.size(); to += width) {
    std::size_t from = tensor.offset;
    for (std::size_t i = 0; i < sides; ++i) from += static_cast<std::size_t>(index[i]) * tensor.strides[i];
    std::memcpy(bytes.data() + to, tensor.storage.data() + from * width, width);
    for (std::size_t i = sides; i-- > 0 && ++index[i] == tensor.shape[i];) index[i] = 0;
  }
  return bytes;
}

}  // namespace

void TensorFile::ReadTorch() {
  // Every storage has a header before it: without this the system would read the surroundings of each, gigabytes in
  // all.
  if (mapping_ != nullptr) ::madvise(mapping_, bytes_.size(), MADV_RANDOM);
  TorchReader reader(bytes_, name_);
  if (mapping_ != nullptr) ::madvise(mapping_, bytes_.size(), MADV_NORMAL);
  std::size_t repacked = 0;
  for (Strided& tensor : reader.Tensors()) {
    const std::size_t count = tensor.ByteCount();
    std::span<const std::byte> bytes;
    if (count > 0 && IsRowByRow(tensor)) {
      bytes = tensor.storage.subspan(tensor.offset * BytesOf(tensor.type), count);
    } else if (count > 0) {
      repacked += count;
      if (repacked > bytes_.size()) throw TensorError(name_ + ": its strided tensors are larger than the file");
      bytes = repacked_.emplace_back(RowByRow(tensor));
    }
    if (!by_name_.emplace(tensor.name, tensors_.size()).second)
      throw TensorError(name_ + ": tensor '" + tensor.name + "' is there twice");
    tensors_.push_back({static_cast<TensorDeclaration&&>(tensor), bytes});
  }
  metadata_["layout"] = reader.layout().empty() ? "plain" : reader.layout();
}

TensorFile TensorFile::OpenTorch(const std::filesystem::path& path) {
  TensorFile file;
  file.Map(path);
  file.ReadTorch();
  return file;
}

TensorFile TensorFile::ParseTorch(std::string bytes, const std::string& name) {
  TensorFile file;
  file.Own(std::move(bytes), name);
  file.ReadTorch();
  return file;
}

TensorFile TensorFile::OpenCheckpoint(const std::filesystem::path& path) {
  TensorFile file;
  file.Map(path);
  const std::string_view start(reinterpret_cast<const char*>(file.bytes_.data()), 8);
  if (start.starts_with(kZip)) {
    file.ReadTorch();
  } else if (start.starts_with("\x80\x02")) {
    throw TensorError(file.name_ +
                      ": a checkpoint of PyTorch before 1.6, which is no zip: load and save it there again");
  } else {
    file.ReadHeader();
  }
  return file;
}

}  // namespace evac
