#include "worldmodel/nn/diffusion_loss.h"

#include <ATen/ops/mse_loss.h>
#include <ATen/ops/ones_like.h>

#include <cmath>

#include "worldmodel/nn/carried_frame.h"

namespace evac::nn {
namespace {

/// Numbers that depend on each row's step, [N, 1, 1, 1, 1] (or [N, 1, 1, 1]).
template <typename Function>
Tensor PerRow(const Tensor& steps, std::int64_t dims, Function value) {
  const Tensor cpu = steps.to(at::kCPU, at::kLong).contiguous();
  std::vector<float> values;
  for (std::int64_t i = 0; i < cpu.numel(); ++i)
    values.push_back(static_cast<float>(value(cpu.data_ptr<std::int64_t>()[i])));
  std::vector<std::int64_t> shape(static_cast<std::size_t>(dims), 1);
  shape[0] = cpu.numel();
  return at::tensor(values).reshape(shape).to(steps.device());
}

struct Levels {
  Tensor signal, noise;
};

Levels LevelsAt(const NoiseSchedule& schedule, const Tensor& steps, std::int64_t dims) {
  return {PerRow(steps, dims, [&](std::int64_t t) { return std::sqrt(schedule.AlphaBar(t)); }),
          PerRow(steps, dims, [&](std::int64_t t) { return std::sqrt(1 - schedule.AlphaBar(t)); })};
}

/// Memory noised by steps that rise towards the newest frame.
Tensor WithNoisyMemory(const NoiseSchedule& schedule, const Tensor& latents, const TeacherForcing& forcing) {
  const std::int64_t rows = latents.size(0), frames = forcing.angle.size(1);
  const Tensor angle = forcing.angle.clamp(0, 1.57);
  const auto all = static_cast<double>(schedule.steps());  // the published 1000
  const Tensor steps = ((1 - angle.cos()) * all / static_cast<double>(forcing.divisor)).to(at::kLong);
  const Levels levels = LevelsAt(schedule, std::get<0>(steps.sort(1)).flatten(), 4);
  const Tensor memory = latents.narrow(2, 0, frames).transpose(1, 2).flatten(0, 1);  // [BV N, z, h, w]
  const Tensor noisy = (memory * levels.signal + forcing.noise * levels.noise)
                           .reshape({rows, frames, latents.size(1), latents.size(3), latents.size(4)})
                           .transpose(1, 2);
  return at::cat({noisy, latents.narrow(2, frames, latents.size(2) - frames)}, 2);
}

}  // namespace

void Remember(const EvacModel& model, const Tensor& memory, Concat& concat, const Tensor& noiseless) {
  const at::NoGradGuard no_gradients;
  const std::int64_t n = memory.size(2), chunk = concat.mask.size(2) - n;
  const Tensor newest = memory.select(2, n - 1);
  concat.still = newest.unsqueeze(2).expand({-1, -1, chunk, -1, -1});
  concat.image = at::cat({memory, concat.still}, 2) * concat.mask;
  if (!model.schedule().carry_plane_m()) return;
  const std::int64_t carried = model.schedule().carry_frames();
  const auto carry = [&](std::int64_t from, std::int64_t count) {
    return CarryLatentsAlongPlane(model, memory.narrow(2, from, count), concat.direction, concat.origin, from, n,
                                  *model.schedule().carry_plane_m(),
                                  noiseless.defined() ? noiseless.narrow(2, from, count) : noiseless);
  };
  const auto behind_memory = [&](const Tensor& before, const Tensor& later) {
    return at::cat({before, later}, 2) * concat.mask;
  };
  const Tensor all_seen = at::ones_like(concat.mask.narrow(2, 0, n));
  const CarriedFrame later = carry(n - carried, carried);
  concat.still = later.frames;
  concat.carried = behind_memory(memory, later.frames);
  concat.seen = behind_memory(all_seen, later.seen);
  if (!model.schedule().carry_first()) return;
  const CarriedFrame first = carry(0, 1);
  concat.first = behind_memory(memory, first.frames);
  concat.first_seen = behind_memory(all_seen, first.seen);
}

Tensor FromLastFrame(const NoiseSchedule& schedule, const Tensor& v, const Concat& concat, const Tensor& t) {
  if (!schedule.from_last_frame()) return v;
  const Tensor& still = concat.carried.defined() ? concat.carried : concat.image;
  return v - still * PerRow(t, 5, [&](std::int64_t step) {
               return std::sqrt(1 - schedule.AlphaBar(step)) * schedule.Scale(step);
             });
}

Tensor LeaveUnchanged(const NoiseSchedule& schedule, const Tensor& imagined, const Tensor& still) {
  const double below = schedule.unchanged_below();
  if (!(below > 0)) return imagined;
  const Tensor change = imagined - still, far = change.square().mean(1, true).sqrt();
  return still + change * (far / below - 1).clamp(0, 1);
}

Tensor DenoiserInput(const Tensor& x, const Concat& concat) {
  std::vector<Tensor> parts = {x, concat.image, concat.mask, concat.pose_map, concat.direction, concat.origin};
  if (concat.carried.defined()) parts.insert(parts.end(), {concat.carried, concat.seen});
  if (concat.first.defined()) parts.insert(parts.end(), {concat.first, concat.first_seen});
  if (concat.object.defined()) parts.push_back(concat.object);
  return at::cat(parts, 1);
}

Tensor ErrorsOfPlaces(const Tensor& found, const Tensor& wanted, double squared_below) {
  const Tensor squared = (found - wanted).square().mean(1, true);
  if (!(squared_below > 0)) return squared;
  return ((squared + squared_below * squared_below).sqrt() - squared_below) * (2 * squared_below);
}

Tensor DiffusionLoss(const EvacModel& model, const DiffusionBatch& batch) {
  const UNet& unet = model.unet();
  const NoiseSchedule& schedule = model.schedule();
  const std::int64_t chunk = batch.latents.size(2) - batch.memory;
  const Tensor latents =
      batch.teacher_forcing ? WithNoisyMemory(schedule, batch.latents, *batch.teacher_forcing) : batch.latents;
  Concat concat = batch.concat;
  const auto memory = [&](const Tensor& of) { return of.narrow(2, 0, batch.memory); };
  if (batch.teacher_forcing || !concat.image.defined())
    Remember(model, memory(latents), concat, memory(batch.latents));
  const Tensor t = batch.t.repeat_interleave(batch.context.views, 0);  // [BV]
  const Levels levels = LevelsAt(schedule, t, 5);
  const Tensor x = latents * PerRow(t, 5, [&](std::int64_t step) { return schedule.Scale(step); });
  const Tensor noisy = x * levels.signal + batch.noise * levels.noise;
  const Tensor target = batch.noise * levels.signal - x * levels.noise;
  const Tensor seen = at::cat({x.narrow(2, 0, batch.memory), noisy.narrow(2, batch.memory, chunk)}, 2);
  const UNet::Input input{DenoiserInput(seen, concat), t, batch.context.views, batch.memory};
  const Tensor v = FromLastFrame(schedule, unet(input, unet.Prepare(batch.context)), concat, t);
  const Tensor found = v.narrow(2, batch.memory, chunk), wanted = target.narrow(2, batch.memory, chunk);
  const Tensor errors = ErrorsOfPlaces(found, wanted, batch.squared_below);
  return (batch.weight.defined() ? errors * batch.weight : errors).mean();
}

}  // namespace evac::nn
