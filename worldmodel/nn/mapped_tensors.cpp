#include "worldmodel/nn/mapped_tensors.h"

#include <memory>

namespace evac::nn {
namespace {

void CloseFile(void* file) { delete static_cast<TensorFile*>(file); }

at::Storage StorageOf(TensorFile* file) {
  void* data = const_cast<std::byte*>(file->bytes().data());
  return at::Storage(at::Storage::use_byte_size_t(), file->bytes().size(),
                     at::DataPtr(data, file, &CloseFile, at::kCPU));
}

}  // namespace

MappedTensors::MappedTensors(TensorFile file) {
  auto owned = std::make_unique<TensorFile>(std::move(file));
  file_ = owned.get();
  storage_ = StorageOf(owned.release());
}

Tensor MappedTensors::Get(const std::string& name) const {
  const TensorView& view = file_->Get(name);
  const Tensor here = TensorFrom(view);
  const std::byte *first = file_->bytes().data(), *at = view.bytes.data();
  const bool is_part = at >= first && view.bytes.size() <= file_->bytes().size() &&
                       static_cast<std::size_t>(at - first) <= file_->bytes().size() - view.bytes.size();
  const auto offset = static_cast<std::size_t>(at - first);
  if (view.bytes.empty() || here.data_ptr() != at) {  // a copy already
    file_->LetGo(view);
    return here;
  }
  if (!is_part || offset % BytesOf(view.type) != 0) return here.clone();
  return at::empty({0}, here.options())
      .set_(storage_, static_cast<std::int64_t>(offset / BytesOf(view.type)), here.sizes(), here.strides());
}

void LetGo(const Tensor& tensor) {
  if (!tensor.defined() || !tensor.has_storage()) return;
  const at::DataPtr& owner = tensor.storage().data_ptr();
  if (owner.get_deleter() != &CloseFile || !tensor.is_contiguous()) return;
  TensorView view;
  view.bytes = {static_cast<const std::byte*>(tensor.data_ptr()), static_cast<std::size_t>(tensor.nbytes())};
  static_cast<const TensorFile*>(owner.get_context())->LetGo(view);
}

}  // namespace evac::nn
