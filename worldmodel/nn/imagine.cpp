#include "worldmodel/nn/imagine.h"

#include <ATen/ops/ones_like.h>
#include <ATen/ops/zeros_like.h>

#include "worldmodel/nn/dpm_solver.h"
#include "worldmodel/nn/frame_actions.h"
#include "worldmodel/nn/hand_views.h"

namespace evac::nn {

Conditioning Condition(const EvacModel& model, const ChunkRequest& request) {
  Conditioning conditioning;
  conditioning.views = request.memory.size(0) / request.deltas.size(0);
  conditioning.memory = request.memory.size(2);
  Concat& concat = conditioning.concat;
  concat.pose_map = at::cat({at::zeros_like(request.memory), request.pose_maps}, 2);
  concat.mask = at::ones_like(concat.pose_map.narrow(1, 0, 1));
  concat.direction = request.direction;
  concat.origin = request.origin;
  Remember(model, request.memory, concat);
  if (model.object_forecast())
    concat.object = model.object_forecast()->Maps(
        {request.image, request.direction, request.origin, request.arms, request.turns});
  conditioning.tokens = model.ContextTokens(model.ImageTokens(request.image), model.ActionTokens(request.deltas));
  if (model.config().unet.frame_actions) conditioning.frames = FrameActions(request.arms, conditioning.memory);
  if (model.config().unet.hand_views > 0)
    conditioning.hands = HandViews(request.image, request.direction, request.origin, request.arms,
                                   model.config().pose_map.tool_length_m);
  return conditioning;
}

Conditioning Unconditioned(const EvacModel& model, const ChunkRequest& request, const Conditioning& conditioning) {
  Conditioning without = conditioning;
  const std::int64_t memory = request.memory.size(2), chunk = request.pose_maps.size(2);
  const Tensor& mask = conditioning.concat.mask;
  without.concat.mask = at::cat({mask.narrow(2, 0, memory), at::zeros_like(mask.narrow(2, memory, chunk))}, 2);
  Remember(model, request.memory, without.concat);
  const Tensor nothing = at::zeros_like(request.image);
  if (conditioning.concat.object.defined()) without.concat.object = at::zeros_like(conditioning.concat.object);
  if (conditioning.hands.defined())
    without.hands = HandViews(nothing, request.direction, request.origin, request.arms,
                              model.config().pose_map.tool_length_m);
  without.tokens = model.ContextTokens(model.ImageTokens(nothing), model.ActionTokens(request.deltas));
  return without;
}

Denoise MakeDenoise(const EvacModel& model, const Conditioning& conditioning) {
  const std::int64_t rows = conditioning.tokens.size(0), views = conditioning.views, memory = conditioning.memory;
  const auto constant = [&](std::int64_t value) { return at::full({rows / views}, value, at::kLong); };
  const at::Device device = conditioning.tokens.device();
  PreparedContext context =
      model.unet().Prepare({conditioning.tokens, constant(model.config().fps).to(device),
                            constant(model.config().domain).to(device), views, conditioning.frames, conditioning.hands});
  return [&model, concat = conditioning.concat, context = std::move(context), views, rows, memory](const Tensor& x_t,
                                                                                                   std::int64_t t) {
    const Tensor steps = at::full({rows}, t, at::kLong).to(x_t.device());
    const Tensor v = model.unet()({DenoiserInput(x_t, concat), steps, views, memory}, context);
    return FromLastFrame(model.schedule(), v, concat, steps);
  };
}

Tensor ImagineChunk(const EvacModel& model, const ChunkRequest& request, const ChunkNoise& noise,
                    const ImagineOptions& options) {
  const Conditioning conditioning = Condition(model, request);
  Denoise denoise = MakeDenoise(model, conditioning);
  if (options.guidance != 1) {
    const Conditioning without = Unconditioned(model, request, conditioning);
    denoise = Guided(denoise, MakeDenoise(model, without), options.guidance, options.guidance_rescale);
  }
  const SampleStart start{at::cat({request.memory, noise.start}, 2), request.memory.size(2),
                          !options.memory_not_scaled};
  const StepObserver observer = [&](std::int64_t, const Tensor&, const Tensor&) {
    if (options.on_step) options.on_step();
  };
  const DdimOptions ddim{options.steps, options.eta, options.residual_noise};
  const Tensor all = options.solver == Solver::kDpmSolver
                         ? SampleDpmSolver(model.schedule(), options.steps, start, denoise, &observer)
                         : SampleDdim(model.schedule(), ddim, start, denoise, noise.step, &observer);
  const std::int64_t memory = conditioning.memory, chunk = all.size(2) - memory;
  const Tensor imagined = LeaveUnchanged(model.schedule(), all.narrow(2, memory, chunk), conditioning.concat.still);
  return at::cat({all.narrow(2, 0, memory), imagined}, 2);
}

}  // namespace evac::nn
