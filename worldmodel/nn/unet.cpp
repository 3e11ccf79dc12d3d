#include "worldmodel/nn/unet.h"

#include <ATen/ops/index_select.h>

#include <algorithm>

#include "worldmodel/nn/frame_actions.h"
#include "worldmodel/nn/hand_views.h"

namespace evac::nn {
namespace {

constexpr double kOutEpsilon = 1e-5;

/// [BV, C, T, h, w] → [BVT, h, w, C], in a row: one scene's would be a view, and layers take other ways for views
Tensor ToRows(const Tensor& x) {
  return x.permute({0, 2, 3, 4, 1}).contiguous().view({-1, x.size(3), x.size(4), x.size(1)});
}

/// [BVT, h, w, C] → [BV, C, T, h, w]
Tensor FromRows(const Tensor& rows, std::int64_t frames) {
  return rows.reshape({-1, frames, rows.size(1), rows.size(2), rows.size(3)}).permute({0, 4, 1, 2, 3}).contiguous();
}

/// As the reference's module answers, for comparisons.
Tensor AsReference(const Tensor& rows, const FrameLayout& layout, bool spatial, bool temporal) {
  const Tensor x = rows.permute({0, 3, 1, 2});  // (b v t) c h w
  const std::int64_t c = x.size(1), h = x.size(2), w = x.size(3);
  const Tensor apart = x.reshape({layout.scenes, layout.views, layout.frames, c, h, w});
  if (temporal) return apart.permute({0, 3, 1, 2, 4, 5}).contiguous();
  if (spatial)
    return apart.permute({0, 2, 3, 1, 4, 5}).reshape({layout.scenes * layout.frames, c, layout.views * h, w});
  return x.contiguous();
}

}  // namespace

struct UNet::Pass {
  const PreparedContext& context;
  FrameLayout layout;
  Tensor embedding;  // [rows, E], SiLU applied
  const Observer* observer;

  void Observe(const std::string& name, const Tensor& rows, const Layer* layer = nullptr) const {
    if (observer == nullptr) return;
    const bool spatial = layer != nullptr && std::holds_alternative<Transformer>(*layer);
    const bool temporal = layer != nullptr && std::holds_alternative<TemporalTransformer>(*layer);
    (*observer)(name, AsReference(rows, layout, spatial, temporal));
  }
};

UNet::Resample::Resample(const Scope& at, std::int64_t channels, bool is_up)
    : up(is_up), conv(at / (is_up ? "conv" : "op"), channels, channels, {.stride = is_up ? 1 : 2}) {}

Tensor UNet::Resample::operator()(const Tensor& x) const { return conv(up ? UpsampleNearest(x) : x); }

UNet::UNet(const Scope& at, const UNetConfig& config)
    : config_(config),
      product_(at.ProductType()),
      domain_embedding_(Precise(at.Take("domain_embedding.weight", {config.domains, 4 * config.model_channels}))),
      time_embed_(at / "time_embed", config.model_channels, 4 * config.model_channels),
      fps_embedding_(at / "fps_embedding", config.model_channels, 4 * config.model_channels),
      width_(config.model_channels) {
  if (config.frame_actions)
    frame_embedding_.emplace(at / "frame_action_embedding", kFrameActionNumbers, 4 * config.model_channels);
  if (config.hand_views > 0)
    hand_embedding_.emplace(at / "hand_view_embedding", config.hand_views * kHandPoints * kHandPointNumbers,
                            4 * config.model_channels);
  MakeInput(at / "input_blocks");
  init_attention_.emplace(
      at / "init_attn" / "0",
      TemporalTransformer::Sizes{config.model_channels, config.init_attention_heads * config.num_head_channels,
                                 config.init_attention_heads, config.transformer_depth, true});
  MakeMiddle(at / "middle_block");
  MakeOutput(at / "output_blocks");
  out_norm_.emplace(at / "out" / "0", config.model_channels, kOutEpsilon);
  out_conv_.emplace(at / "out" / "2", config.model_channels, config.out_channels);
}

bool UNet::HasAttention() const {
  const auto& at = config_.attention_resolutions;
  return std::find(at.begin(), at.end(), downsampling_) != at.end();
}

void UNet::AddTransformers(Block& block, const Scope& at, std::int64_t channels) {
  const std::int64_t heads = channels / config_.num_head_channels, depth = config_.transformer_depth;
  const Listens listens = listens_.size() % 2 == 0 ? Listens::kActions : Listens::kImage;
  const auto place = static_cast<std::int64_t>(block.size());
  block.push_back(Transformer{SpatialTransformer(at / place, {channels, heads, depth, config_.context_dim, listens}),
                              listens_.size()});
  block.push_back(TemporalTransformer(at / (place + 1), {channels, channels, heads, depth, false}));
  listens_.push_back(listens);
}

void UNet::MakeInput(const Scope& at) {
  const std::int64_t embedding = 4 * config_.model_channels;
  std::int64_t place = 0;
  const auto add = [&](Block block) {
    input_blocks_.push_back(std::move(block));
    skips_.push_back(width_);
    ++place;
  };
  add({Conv2d(at / place / 0, config_.in_channels, width_)});
  for (std::size_t level = 0; level < config_.channel_mult.size(); ++level) {
    const std::int64_t width = config_.model_channels * config_.channel_mult[level];
    for (std::int64_t i = 0; i < config_.num_res_blocks; ++i) {
      Block block = {ResBlock(at / place / 0, {width_, width, embedding})};
      width_ = width;
      if (HasAttention()) AddTransformers(block, at / place, width);
      add(std::move(block));
    }
    if (level + 1 == config_.channel_mult.size()) break;
    add({Resample(at / place / 0, width_, false)});
    downsampling_ *= 2;
  }
}

void UNet::MakeMiddle(const Scope& at) {
  const ResBlock::Sizes sizes = {width_, width_, 4 * config_.model_channels};
  middle_.push_back(ResBlock(at / 0, sizes));
  AddTransformers(middle_, at, width_);
  middle_.push_back(ResBlock(at / 3, sizes));
}

void UNet::MakeOutput(const Scope& at) {
  std::int64_t place = 0;
  for (std::size_t level = config_.channel_mult.size(); level-- > 0;) {
    const std::int64_t width = config_.model_channels * config_.channel_mult[level];
    for (std::int64_t i = 0; i <= config_.num_res_blocks; ++i, ++place) {
      Block block = {ResBlock(at / place / 0, {width_ + skips_.back(), width, 4 * config_.model_channels})};
      skips_.pop_back();
      width_ = width;
      if (HasAttention()) AddTransformers(block, at / place, width);
      if (level > 0 && i == config_.num_res_blocks) {
        block.push_back(Resample(at / place / static_cast<std::int64_t>(block.size()), width, true));
        downsampling_ /= 2;
      }
      output_blocks_.push_back(std::move(block));
    }
  }
}

PreparedContext UNet::Prepare(const Context& context) const {
  const std::int64_t images = config_.image_tokens, actions = config_.action_tokens, dim = config_.context_dim;
  CheckShape("context", context.tokens, {-1, images + actions, dim});
  const Tensor by_scene = context.tokens.reshape({-1, context.views, images + actions, dim});
  const Tensor image =
      InProductType(by_scene.narrow(2, 0, images).reshape({by_scene.size(0), context.views * images, dim}));
  const Tensor action = InProductType(by_scene.select(1, 0).narrow(1, images, actions).contiguous());
  PreparedContext prepared;
  const auto prepare = [&](const Block& block) {
    for (const Layer& layer : block) {
      if (const auto* transformer = std::get_if<Transformer>(&layer)) {
        const bool hears_image = transformer->spatial.listens() == Listens::kImage;
        prepared.keys_values.push_back(transformer->spatial.Prepare(hears_image ? image : action));
      }
    }
  };
  for (const Block& block : input_blocks_) prepare(block);
  prepare(middle_);
  for (const Block& block : output_blocks_) prepare(block);
  prepared.embedding = fps_embedding_(SinusoidEmbedding(context.fps, config_.model_channels)) +
                       domain_embedding_.index_select(0, context.domain.to(at::kLong));
  if (frame_embedding_) {
    if (!context.frames.defined()) throw TensorError("the network wants the arms of each frame, found none");
    CheckShape("arms of each frame", context.frames, {prepared.embedding.size(0), -1, kFrameActionNumbers});
    prepared.frames = (*frame_embedding_)(context.frames);
  }
  if (hand_embedding_) {
    if (!context.hands.defined()) throw TensorError("the network wants what is about each hand, found nothing");
    CheckShape("what is about each hand", context.hands,
               {prepared.embedding.size(0), -1, 2, config_.hand_views * kHandPoints * kHandPointNumbers});
    const Tensor about_hands = (*hand_embedding_)(context.hands).sum(2);
    prepared.frames = prepared.frames.defined() ? prepared.frames + about_hands : about_hands;
  }
  return prepared;
}

Tensor UNet::InProductType(const Tensor& x) const { return product_ ? x.to(*product_) : x; }

Tensor UNet::Embedding(const Input& input, const PreparedContext& context) const {
  const std::int64_t rows = input.x.size(0), frames = input.x.size(2);
  const auto embed = [&](const Tensor& t) {
    return time_embed_(SinusoidEmbedding(t, config_.model_channels)).unsqueeze(1);
  };
  const std::int64_t width = context.embedding.size(1);
  const Tensor memory = embed(at::zeros({rows}, input.t.options())).expand({rows, input.memory, width});
  const Tensor chunk = embed(input.t).expand({rows, frames - input.memory, width});
  Tensor per_frame = context.embedding.unsqueeze(1);  // [B, 1, E] or [B, T, E]
  if (context.frames.defined()) per_frame = per_frame + context.frames;
  return at::silu(at::cat({memory, chunk}, 1) + per_frame.repeat_interleave(input.views, 0))
      .reshape({rows * frames, width});
}

Tensor UNet::Run(const Block& block, const std::string& name, const Tensor& x, const Pass& pass) const {
  Tensor h = x;
  for (std::size_t i = 0; i < block.size(); ++i) {
    if (const auto* conv = std::get_if<Conv2d>(&block[i])) h = (*conv)(h);
    if (const auto* res = std::get_if<ResBlock>(&block[i])) h = (*res)(h, pass.embedding, pass.layout);
    if (const auto* spatial = std::get_if<Transformer>(&block[i]))
      h = spatial->spatial(h, pass.context.keys_values[spatial->index], pass.layout);
    if (const auto* temporal = std::get_if<TemporalTransformer>(&block[i])) h = (*temporal)(h, pass.layout);
    if (const auto* resample = std::get_if<Resample>(&block[i])) h = (*resample)(h);
    pass.Observe(name + "." + std::to_string(i), h, &block[i]);
  }
  pass.Observe(name, h);
  return h;
}

Tensor UNet::operator()(const Input& input, const PreparedContext& context, const Observer* observer) const {
  CheckShape("denoiser input", input.x, {-1, config_.in_channels, -1, -1, -1});
  CheckShape("diffusion steps", input.t, {input.x.size(0)});
  const std::int64_t frames = input.x.size(2);
  const Pass pass{
      context, {input.x.size(0) / input.views, input.views, frames}, InProductType(Embedding(input, context)), observer};
  std::vector<Tensor> skips;
  Tensor h = InProductType(ToRows(input.x));
  for (std::size_t i = 0; i < input_blocks_.size(); ++i) {
    h = Run(input_blocks_[i], "input_blocks." + std::to_string(i), h, pass);
    if (i == 0) h = (*init_attention_)(h, pass.layout);
    if (i == 0) pass.Observe("init_attn", h);
    skips.push_back(h);
  }
  h = Run(middle_, "middle_block", h, pass);
  for (std::size_t i = 0; i < output_blocks_.size(); ++i) {
    h = at::cat({h, skips.back()}, -1);
    skips.pop_back();
    h = Run(output_blocks_[i], "output_blocks." + std::to_string(i), h, pass);
  }
  return FromRows((*out_conv_)((*out_norm_)(h, Activation::kSilu)), frames).to(input.x.scalar_type());
}

}  // namespace evac::nn
