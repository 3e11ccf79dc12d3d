#pragma once

// The one place of the network that names libtorch's headers: the narrow ones, because torch/torch.h costs a minute of
// compiling for every ten files. No header outside worldmodel/nn and worldmodel/train includes this one.
#include <ATen/TensorOperators.h>
#include <ATen/core/Tensor.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/arange.h>
#include <ATen/ops/cat.h>
#include <ATen/ops/conv2d.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/full.h>
#include <ATen/ops/gelu.h>
#include <ATen/ops/group_norm.h>
#include <ATen/ops/layer_norm.h>
#include <ATen/ops/linear.h>
#include <ATen/ops/matmul.h>
#include <ATen/ops/ones.h>
#include <ATen/ops/silu.h>
#include <ATen/ops/softmax.h>
#include <ATen/ops/stack.h>
#include <ATen/ops/tensor.h>
#include <ATen/ops/zeros.h>

#include <string>
#include <vector>

#include "core/tensor_file.h"

/// Tensors, no robots. Every shape is written where a tensor is named: B scenes, V views, T frames (N memory, newest
/// last, then K to imagine), C channels, H W image, h w latent, L tokens.
namespace evac::nn {

using at::Tensor;

/// "[2, 4, 8, 16]" for messages.
std::string ShapeText(at::IntArrayRef shape);

/// The file's bytes as a tensor, without a copy where their alignment allows: then the file must outlive it.
Tensor TensorFrom(const TensorView& view);
/// The numbers of a contiguous CPU tensor, for a file.
TensorView ViewOf(const std::string& name, const Tensor& tensor);

/// @throws TensorError "NAME is [..], wanted [..]"; -1 in `wanted` stands for any size.
void CheckShape(const std::string& name, const Tensor& tensor, at::IntArrayRef wanted);

}  // namespace evac::nn
