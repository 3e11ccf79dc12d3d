#include "judges/classifier_judge.h"

#include <ATen/TensorOperators.h>
#include <ATen/core/grad_mode.h>
#include <ATen/ops/empty.h>
#include <ATen/ops/from_blob.h>
#include <ATen/ops/zeros.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "core/weight_file.h"
#include "judges/classifier_clip.h"
#include "judges/classifier_net.h"
#include "judges/judge_card.h"

namespace evac {
namespace {

ClassifierShape ShapeOf(const WeightFile& file) {
  if (file.Whole("frames", 1, 1000) != kClassifierFrames)
    throw InvalidInput("{}: a classifier of {} pictures, wanted {}", file.name(), file.Text("frames"),
                       kClassifierFrames);
  ClassifierShape shape{file.Names("tasks"), file.Names("cameras"), file.Whole("height_px", 8, 4096),
                        file.Whole("width_px", 8, 4096)};
  shape.looks = LooksOnCard(file);
  if (shape.height_px % 8 != 0 || shape.width_px % 8 != 0)
    throw InvalidInput("{}: pictures of {}x{}, wanted multiples of 8", file.name(), shape.width_px, shape.height_px);
  return shape;
}

ClassifierCard CardOf(const WeightFile& file) {
  ClassifierCard card{file.Number("temperature"), file.Number("threshold"), file.Number("unsure")};
  if (card.temperature <= 0 || card.threshold <= 0 || card.threshold >= 1 || card.unsure < 0)
    throw InvalidInput("{}: temperature {}, threshold {}, unsure {}: wanted above 0, in (0, 1), at least 0",
                       file.name(), card.temperature, card.threshold, card.unsure);
  if (file.card().contains("offset")) card.offset = file.Number("offset");
  if (file.card().contains("longest_frames")) card.longest_frames = file.Whole("longest_frames", 1, 1000000);
  return card;
}

TakeParameter From(WeightFile& file) {
  return [&file](const std::string& key, const std::vector<std::int64_t>& shape) {
    const TensorView& view = file.Take(key, shape);
    at::Tensor copy = at::empty(shape, at::kFloat);
    std::memcpy(copy.data_ptr(), view.bytes.data(), view.bytes.size());
    return copy;
  };
}

template <typename Names>
std::int64_t IndexIn(const Names& names, const std::string& name) {
  const auto found = std::find(names.begin(), names.end(), name);
  return found == names.end() ? -1 : found - names.begin();
}

}  // namespace

struct ClassifierJudge::Network {
  explicit Network(WeightFile& file) : shape(ShapeOf(file)), net(shape, From(file)) { file.RequireAllTaken(); }

  /// What libtorch refuses (no memory) is not the clip's doing.
  double LogitOf(const ClassifierClips& clip) const try {
    return net(clip).logit.item<double>();
  } catch (const c10::Error& error) {
    throw InternalError("the judge's network cannot be asked: {}", error.what_without_backtrace());
  }

  ClassifierShape shape;
  ClassifierNet net;
};

Label LabelOf(double probability, const ClassifierCard& card) {
  if (std::abs(probability - card.threshold) < card.unsure) return Label::kCannotTell;
  return probability >= card.threshold ? Label::kSuccess : Label::kFailure;
}

ClassifierJudge::ClassifierJudge(const std::filesystem::path& weights, std::filesystem::path run)
    : run_(std::move(run)) {
  WeightFile file(weights, kClassifierFormat);
  card_ = CardOf(file);
  if (file.card().contains("learned_from")) {
    const std::vector<std::string> marks = file.Names("learned_from");
    learned_from_ = {marks.begin(), marks.end()};
  }
  network_ = std::make_unique<const Network>(file);
  name_ = ClassifierName(weights);
}

ClassifierJudge::~ClassifierJudge() = default;

std::string ClassifierJudge::Name() const { return name_; }

void ClassifierJudge::CheckKnows(std::span<const Task> tasks) const {
  const ClassifierShape& shape = network_->shape;
  for (const Task& task : tasks) {
    if (IndexIn(shape.tasks, task.id) < 0)
      throw InvalidInput("{}: task {} is none it learned, wanted one of {}", name_, task.id,
                         fmt::join(shape.tasks, ", "));
    bool has_main_view = false;
    for (const Camera& camera : task.cameras) {
      has_main_view |= camera.name == shape.cameras.front();
      if (IndexIn(shape.cameras, camera.name) < 0)
        throw InvalidInput("{}: task {} has a camera {}, of which it learned nothing; it knows {}", name_, task.id,
                           camera.name, fmt::join(shape.cameras, ", "));
    }
    if (!has_main_view)
      throw InvalidInput("{}: task {} has no camera {}, without which it cannot judge", name_, task.id,
                         shape.cameras.front());
  }
}

double ClassifierJudge::Probability(const Task& task, const std::filesystem::path& video) const {
  const at::NoGradGuard no_gradients;
  const ClassifierShape& shape = network_->shape;
  const auto views = static_cast<std::int64_t>(shape.cameras.size());
  const ClipLook look{
      task.cameras, static_cast<int>(kClassifierFrames), {shape.width_px, shape.height_px}, card_.longest_frames};
  const std::vector<std::vector<cv::Mat>> seen = ReadClip(video, look);
  at::Tensor bytes = at::zeros({1, views, kClassifierFrames, shape.height_px, shape.width_px, 3}, at::kByte);
  ClassifierClips clip{{}, at::zeros({1, views}), at::zeros({1}, at::kLong)};
  clip.task[0] = IndexIn(shape.tasks, task.id);
  const auto picture_bytes = static_cast<std::size_t>(shape.height_px * shape.width_px * 3);
  for (std::size_t v = 0; v < seen.size(); ++v) {
    const std::int64_t view = IndexIn(shape.cameras, task.cameras[v].name);
    clip.present[0][view] = 1;
    auto* to = bytes[0][view].data_ptr<std::uint8_t>();
    for (const cv::Mat& picture : seen[v]) {
      std::memcpy(to, picture.data, picture_bytes);
      to += picture_bytes;
    }
  }
  clip.pictures = bytes.to(at::kFloat) / 127.5 - 1;
  const double logit = network_->LogitOf(clip);
  if (!std::isfinite(logit))  // it would be below any threshold: an error is not a failure
    throw InvalidInput("{}: {}: its network answers {}, wanted a finite number", video.string(), name_, logit);
  return 1 / (1 + std::exp((card_.offset - logit) / card_.temperature));
}

Verdict ClassifierJudge::Rate(const Task& task, const Episode& episode) {
  CheckKnows({&task, 1});
  if (episode.video.empty()) throw InvalidInput("{}: it has no clip", episode.key.Id()).Called("not_judged");
  if (learned_from_.contains(ClipMark(episode.video_sha256)))
    throw InvalidInput("{}: {} learned from this clip, and cannot judge it", episode.key.Id(), name_);
  Verdict verdict;
  verdict.episode_id = episode.key.Id();
  verdict.judge = name_;
  verdict.probability = Probability(task, run_ / episode.video);
  verdict.label = LabelOf(*verdict.probability, card_);
  verdict.reason = fmt::format("probability of success {:.3f}; success from {:.3f} on, cannot tell within {:.3f} of it",
                               *verdict.probability, card_.threshold, card_.unsure);
  verdict.rubric_version = task.rubric.version;
  return verdict;
}

}  // namespace evac
