#include <algorithm>
#include <map>

#include "worldmodel/nn/number_text.h"
#include "worldmodel/nn/weights.h"

namespace evac::nn {
namespace {

struct Plan {
  std::vector<ParameterShape> keys;
  std::vector<TensorDeclaration> declarations;
  std::map<std::string, std::vector<float>> schedule;
  std::size_t bytes = 0;
};

Plan MakePlan(const ModelConfig& config, const SaveOptions& options) {
  Plan plan;
  for (NoiseSchedule::Buffer& buffer : NoiseSchedule(config.schedule).Buffers())
    plan.schedule.emplace(buffer.key, std::move(buffer.values));
  const TensorType type = ViewOf("parameters", at::empty({0}, options.dtype)).type;
  for (ParameterShape& key : CheckpointKeys(config)) {
    if (std::find(options.without.begin(), options.without.end(), key.key) != options.without.end()) continue;
    const bool is_schedule = plan.schedule.contains(key.key);
    plan.declarations.push_back({key.key, is_schedule ? TensorType::kF32 : type, key.shape});
    plan.bytes += plan.declarations.back().ByteCount();
    plan.keys.push_back(std::move(key));
  }
  return plan;
}

}  // namespace

Tensor InType(const std::string& name, const Tensor& tensor, at::ScalarType type) {
  const Tensor written = tensor.to(type);
  const bool is_narrower = type == at::kHalf || tensor.scalar_type() == at::kDouble;  // bf16 goes as far as f32
  if (!is_narrower || written.is_same(tensor)) return written;
  const Tensor lost = tensor.masked_select(written.isinf().logical_and(tensor.isfinite()));
  if (lost.numel() == 0) return written;
  throw TensorError(name + " holds " + TextOfNumber(lost[0].item<double>()) + ", which is infinite in " +
                    Name(ViewOf(name, at::empty({0}, type)).type) +
                    ": wanted a type that reaches further, as BF16 and F32 do");
}

void SaveWeights(const std::filesystem::path& path, ParameterSource& source, const ModelConfig& config,
                 const SaveOptions& options) {
  const Plan plan = MakePlan(config, options);
  TensorFileWriter writer(path, plan.declarations, options.metadata);
  std::size_t done = 0;
  for (const auto& [key, shape] : plan.keys) {
    if (const auto buffer = plan.schedule.find(key); buffer != plan.schedule.end()) {
      writer.Append(std::as_bytes(std::span(buffer->second)));
      done += buffer->second.size() * sizeof(float);
      continue;
    }
    const Tensor given = source.Take(key, shape);
    CheckShape(key, given, shape);
    const Tensor written = InType(path.string() + ": " + key, given.to(at::kCPU), options.dtype).contiguous();
    const TensorView view = ViewOf(key, written);
    writer.Append(view.bytes);
    LetGo(given);
    done += view.bytes.size();
    if (options.progress) options.progress(done, plan.bytes);
  }
  writer.Finish();
}

}  // namespace evac::nn
