#include <algorithm>
#include <map>

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
    const Tensor written = given.to(given.options().dtype(options.dtype).device(at::kCPU)).contiguous();
    const TensorView view = ViewOf(key, written);
    writer.Append(view.bytes);
    LetGo(given);
    done += view.bytes.size();
    if (options.progress) options.progress(done, plan.bytes);
  }
  writer.Finish();
}

}  // namespace evac::nn
