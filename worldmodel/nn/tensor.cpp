#include "worldmodel/nn/tensor.h"

#include <cstring>

namespace evac::nn {
namespace {

struct TypeRow {
  TensorType file;
  at::ScalarType tensor;
};
constexpr TypeRow kTypes[] = {{TensorType::kBool, at::kBool}, {TensorType::kU8, at::kByte},
                              {TensorType::kI8, at::kChar},   {TensorType::kI16, at::kShort},
                              {TensorType::kI32, at::kInt},   {TensorType::kI64, at::kLong},
                              {TensorType::kF16, at::kHalf},  {TensorType::kBF16, at::kBFloat16},
                              {TensorType::kF32, at::kFloat}, {TensorType::kF64, at::kDouble}};

at::ScalarType TypeOf(TensorType type) { return kTypes[static_cast<std::size_t>(type)].tensor; }

TensorType FileTypeOf(const std::string& name, at::ScalarType type) {
  for (const TypeRow& row : kTypes) {
    if (row.tensor == type) return row.file;
  }
  throw TensorError("tensor '" + name + "': no file holds its type");
}

}  // namespace

std::string ShapeText(at::IntArrayRef shape) {
  std::string text = "[";
  for (std::size_t i = 0; i < shape.size(); ++i) text += (i ? ", " : "") + std::to_string(shape[i]);
  return text + "]";
}

Tensor TensorFrom(const TensorView& view) {
  const at::TensorOptions options = at::TensorOptions().dtype(TypeOf(view.type));
  if (reinterpret_cast<std::uintptr_t>(view.bytes.data()) % BytesOf(view.type) == 0 && !view.bytes.empty()) {
    return at::from_blob(const_cast<std::byte*>(view.bytes.data()), view.shape, options);  // read-only by agreement
  }
  Tensor tensor = at::empty(view.shape, options);
  if (!view.bytes.empty()) std::memcpy(tensor.data_ptr(), view.bytes.data(), view.bytes.size());
  return tensor;
}

TensorView ViewOf(const std::string& name, const Tensor& tensor) {
  if (!tensor.is_contiguous() || !tensor.is_cpu())
    throw TensorError("tensor '" + name + "': only contiguous CPU tensors are written");
  const TensorType type = FileTypeOf(name, tensor.scalar_type());
  TensorView view{{name, type, tensor.sizes().vec()}, {}};
  view.bytes = {static_cast<const std::byte*>(tensor.data_ptr()), view.ByteCount()};
  return view;
}

void CheckShape(const std::string& name, const Tensor& tensor, at::IntArrayRef wanted) {
  bool fits = tensor.defined() && tensor.dim() == static_cast<std::int64_t>(wanted.size());
  for (std::size_t i = 0; fits && i < wanted.size(); ++i)
    fits = wanted[i] < 0 || wanted[i] == tensor.size(static_cast<std::int64_t>(i));
  if (fits) return;
  throw TensorError(name + " is " + (tensor.defined() ? ShapeText(tensor.sizes()) : std::string("missing")) +
                    ", wanted " + ShapeText(wanted));
}

}  // namespace evac::nn
