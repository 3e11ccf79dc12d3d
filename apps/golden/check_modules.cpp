#include <fmt/format.h>

#include <map>
#include <regex>

#include "apps/golden/golden_checks.h"
#include "worldmodel/nn/ddim.h"
#include "worldmodel/nn/imagine.h"
#include "worldmodel/nn/parameters.h"
#include "worldmodel/nn/pictures.h"
#include "worldmodel/pose_map.h"

namespace evac::golden {
namespace {

constexpr double kFloatRounding = 2e-6;

Tensor ColourTable(Side side) {
  std::vector<std::uint8_t> table;
  for (int i = 0; i < 256; ++i) {
    const auto colour = ClosureColour(side, (static_cast<float>(i) + 0.5F) / 256);
    table.insert(table.end(), colour.begin(), colour.end());
  }
  return at::from_blob(table.data(), {256, 3}, at::kByte).clone();
}

/// "ddim27_eta1_": a table of 27 steps at eta 1.
void CheckDdimTable(const GoldenFile& file, const std::string& prefix, const nn::DdimOptions& options,
                    Comparison& comparison) {
  const nn::NoiseSchedule schedule{nn::ScheduleConfig{}};
  std::map<std::string, std::vector<double>> columns;
  std::vector<double> steps;
  for (const nn::DdimStep& step : nn::DdimTable(schedule, options)) {
    steps.push_back(static_cast<double>(step.t));
    columns["sigmas"].push_back(step.sigma);
    columns["alphas"].push_back(step.alpha_bar);
    columns["alphas_prev"].push_back(step.alpha_bar_previous);
    columns["sqrt_one_minus_alphas"].push_back(std::sqrt(1 - step.alpha_bar));
    columns["scale_arr"].push_back(step.scale);
    columns["scale_arr_prev"].push_back(step.scale_previous);
  }
  for (const auto& [column, values] : columns) {
    for (const char* suffix : {"", "_f64"}) {
      const std::string name = prefix + "ddim_" + column + suffix;
      if (file.Has(name)) comparison.Within(name, at::tensor(values, at::kDouble), file.Get(name), kFloatRounding);
    }
  }
  const std::string timesteps = fmt::format("ddim{}_timesteps", options.steps);
  comparison.Same(timesteps, at::tensor(steps, at::kDouble), file.Get(timesteps));
}

/// The picture the encoder was given: at full precision where the folder has it.
Tensor EncoderInput(const GoldenFile& file, const Workshop& workshop, const std::string& size) {
  const Tensor stored = file.Get("in_" + size);
  if (stored.scalar_type() == at::kFloat) return stored;
  std::smatch sides;
  static const std::regex kSize("([0-9]+)x([0-9]+)");
  if (!std::regex_match(size, sides, kSize)) throw TensorError("in_" + size + ": no size");
  const Tensor frame = workshop.FirstFrame().unsqueeze(0);
  return nn::ToNetworkRange(nn::ResizeAntialiased(frame, std::stol(sides[1]), std::stol(sides[2])));
}

}  // namespace

void CheckSchedule(const GoldenFile& file, Workshop&, Comparison& comparison) {
  const nn::NoiseSchedule schedule{nn::ScheduleConfig{}};
  for (const nn::NoiseSchedule::Buffer& buffer : schedule.Buffers())
    comparison.Close(buffer.key, at::tensor(buffer.values), file.Get(buffer.key), kFloatRounding);
  if (file.Has("lvlb_weights"))
    comparison.Same("lvlb_weights", at::tensor(schedule.LossWeights()), file.Get("lvlb_weights"));
  static const std::regex kTable("ddim([0-9]+)_eta([0-9])_ddim_sigmas");
  for (const std::string& name : file.Names()) {
    std::smatch match;
    if (!std::regex_match(name, match, kTable)) continue;
    const nn::DdimOptions options{std::stol(match[1]), std::stod(match[2]), true};
    CheckDdimTable(file, fmt::format("ddim{}_eta{}_", match[1].str(), match[2].str()), options, comparison);
  }
  comparison.Same("lut_greens_u8", ColourTable(Side::kLeft), file.Get("lut_greens_u8"));
  comparison.Same("lut_reds_u8", ColourTable(Side::kRight), file.Get("lut_reds_u8"));
}

void CheckWeights(const GoldenFile& file, Workshop&, Comparison& comparison) {
  nn::HashWeights hashes;
  nn::RecordedWeights weights(hashes);
  const nn::EvacModel model(weights, file.Model());
  std::vector<double> sums;
  for (const nn::RecordedWeights::Parameter& parameter : weights.parameters())
    sums.push_back(parameter.tensor.to(at::kDouble).sum().item<double>());
  comparison.Close("sum_f64", at::tensor(sums, at::kDouble), file.Get("sum_f64"), 1e-9);
  for (const std::string& name : file.Names()) {
    if (name != "sum_f64") comparison.Same(name, weights.Get(name), file.Get(name));
  }
}

void CheckImageResize(const GoldenFile& file, Workshop& workshop, Comparison& comparison) {
  static const std::regex kPicture("r([0-9]+)x([0-9]+)");  // _noaa is the wrong way, for contrast
  const Tensor frame = workshop.FirstFrame().unsqueeze(0);
  for (const std::string& name : file.Names()) {
    std::smatch sides;
    if (!std::regex_match(name, sides, kPicture)) continue;
    comparison.Close(name, nn::ResizeAntialiased(frame, std::stol(sides[1]), std::stol(sides[2]))[0], file.Get(name),
                     2e-6);
  }
}

void CheckVae(const GoldenFile& file, Workshop& workshop, Comparison& comparison) {
  const nn::EvacModel& model = workshop.ModelFor(file.Model());
  const nn::Posterior posterior = model.vae().Encode(file.Get("x"));
  const Tensor mode = posterior.Sample({}) * model.vae().scale_factor();
  comparison.Close("moments", posterior.moments, file.Get("moments"), kModuleTolerance);
  comparison.Close("z_mode_scaled", mode, file.Get("z_mode_scaled"), kModuleTolerance);
  comparison.Close("dec_of_z_mode", model.vae().Decode(file.Get("z_mode_scaled")), file.Get("dec_of_z_mode"),
                   kModuleTolerance);
  const Tensor sampled = nn::EncodeImages(model, file.Get("x"), at::cat(file.Noise(), 0));
  comparison.Close("z_sampled", sampled.transpose(0, 1).unsqueeze(0), file.Get("z_sampled"), kModuleTolerance);
}

void CheckClipResampler(const GoldenFile& file, Workshop& workshop, Comparison& comparison) {
  const nn::EvacModel& model = workshop.ModelFor(file.Model());
  const std::int64_t side = model.image_encoder().image_px();
  for (const std::string& prefix : file.Names()) {
    if (!prefix.starts_with("pre_")) continue;
    const Tensor input = EncoderInput(file, workshop, prefix.substr(4));
    const Tensor got = nn::PreprocessForEncoder(input.dim() == 3 ? input.unsqueeze(0) : input, side);
    comparison.Close(prefix, got, file.Get(prefix), kModuleTolerance);
    const bool is_source =
        file.Has("pre_320x512") ? prefix == "pre_320x512" : got.size(0) == file.Get("clip_tokens").size(0);
    if (is_source)
      comparison.Close("clip_tokens", model.image_encoder()(file.Get(prefix)), file.Get("clip_tokens"),
                       kModuleTolerance);
  }
  comparison.Close("img_tokens", model.image_resampler()(file.Get("clip_tokens")), file.Get("img_tokens"),
                   kModuleTolerance);
  for (const std::string& name : file.Names()) {
    if (!name.starts_with("act_tokens")) continue;
    const std::string steps = name.substr(std::string("act_tokens").size());
    comparison.Close(name, model.ActionTokens(file.Get("delta" + steps)), file.Get(name), kModuleTolerance);
  }
}

void CheckUNet(const GoldenFile& file, Workshop& workshop, Comparison& comparison) {
  const nn::ModelConfig config = file.Model();
  const nn::UNet& unet = workshop.ModelFor(config).unet();
  const nn::Observer observer = [&](const std::string& name, const Tensor& output) {
    if (!file.Has("mid." + name)) return;
    const Tensor wanted = file.Get("mid." + name);  // of large tensors only the leading rows were kept
    comparison.Close("mid." + name, output.narrow(0, 0, std::min(wanted.size(0), output.size(0))), wanted,
                     kModuleTolerance);
  };
  const Tensor x = file.Get("x");
  const nn::PreparedContext context =
      unet.Prepare({file.Get("context"), file.Get("fs"), file.Get("domain_id"), config.views});
  const Tensor out = unet({x, file.Get("t"), config.views, config.memory}, context, &observer);
  comparison.Close("out", out, file.Get("out"), kModuleTolerance);
}

}  // namespace evac::golden
