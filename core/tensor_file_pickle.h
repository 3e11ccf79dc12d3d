#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace evac {

/// Something of a pickle. Those it holds are places in Pickle::values: nothing here is nested, whatever the pickle is.
struct PickleValue {
  enum class Kind : std::uint8_t {
    kNone,
    kBool,
    kInt,
    kFloat,
    kText,
    kTuple,
    kList,
    kDict,
    kGlobal,
    kStorage,
    kTensor,
    kInert
  };
  Kind kind = Kind::kNone;
  std::int64_t number = 0;  ///< of kBool, kInt
  std::string text;         ///< of kText; of kGlobal "module.name"
  /// kTuple, kList: what it holds. kDict: key, value, key, value, … kStorage: type, key, location, count.
  /// kTensor: storage, offset, shape, strides.
  std::vector<std::uint32_t> items;
};

struct Pickle {
  std::vector<PickleValue> values;
  std::uint32_t root = 0;
};

/// Reads a pickle of protocol 2 as a list of values. No name in it is looked up and nothing is called: the few
/// callables that torch.save writes are recognised by their names (docs/weights.md), any other ends the reading.
/// @param file  stands for it in messages
/// @throws TensorError naming the callable or the opcode that is not of a checkpoint; or that it is cut off, or beyond
///   64 MB or 4 million values.
Pickle ReadPickle(std::span<const std::byte> bytes, const std::string& file);

}  // namespace evac
