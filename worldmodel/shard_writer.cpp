#include "worldmodel/shard_writer.h"

#include <fmt/format.h>

#include "core/error.h"

namespace evac {
namespace {

TensorDeclaration Declare(const char* name, TensorType type, std::vector<std::int64_t> shape) {
  TensorDeclaration declaration;
  declaration.name = name;
  declaration.type = type;
  declaration.shape = std::move(shape);
  return declaration;
}

/// What is known of each clip as a whole.
struct Heads {
  std::vector<std::int64_t> clip_start = {0}, clip_id;
  std::vector<std::int32_t> crop, task;
  std::vector<std::int8_t> outcome;

  explicit Heads(std::span<const Clip> clips) {
    for (const Clip& clip : clips) {
      clip_start.push_back(clip_start.back() + static_cast<std::int64_t>(clip.length));
      clip_id.push_back(clip.recording);
      crop.insert(crop.end(), {clip.crop.x_px, clip.crop.y_px, clip.crop.width_px, clip.crop.height_px});
      task.push_back(clip.task);
      outcome.push_back(clip.outcome);
    }
  }
};

std::vector<TensorDeclaration> Declarations(std::int64_t clips, std::int64_t frames, std::int64_t views,
                                            const cv::Size& size_px) {
  using enum TensorType;
  const std::vector<std::int64_t> pictures = {frames, views, size_px.height, size_px.width, 3};
  return {Declare("clip_start", kI64, {clips + 1}),
          Declare("clip_id", kI64, {clips}),
          Declare("crop", kI32, {clips, 4}),
          Declare("task", kI32, {clips}),
          Declare("actions", kF32, {frames, 16}),
          Declare("deltas", kF32, {frames, 14}),
          Declare("c2w", kF32, {frames, views, 4, 4}),
          Declare("k", kF32, {frames, views, 3, 3}),
          Declare("object_px", kF32, {frames, views, 2}),
          Declare("outcome", kI8, {clips}),
          Declare("contact", kU8, {frames}),
          Declare("frames", kU8, pictures),
          Declare("maps", kU8, pictures)};  // larger numbers first: all are aligned
}

}  // namespace

void WriteShard(const std::filesystem::path& path, std::span<const Clip> clips, const cv::Size& picture_px,
                TensorMetadata metadata) {
  const Heads heads(clips);
  for (const Clip& clip : clips) {
    if (clip.views != clips.front().views)
      throw InternalError("{}: a clip of {} views beside one of {}", path.string(), clip.views, clips.front().views);
  }
  metadata["format"] = std::string("evac-shard");
  metadata["version"] = std::string("1");  // g++ 12 sees an endless copy in string = "text" (its bug 105651)
  const std::vector<TensorDeclaration> declarations =
      Declarations(static_cast<std::int64_t>(clips.size()), heads.clip_start.back(),
                   static_cast<std::int64_t>(clips.front().views), picture_px);
  TensorFileWriter writer(path, declarations, metadata);
  const auto append = [&](const auto& values) { writer.Append(std::as_bytes(std::span(values))); };
  const auto append_of_all = [&](auto field) {
    for (const Clip& clip : clips) append(clip.*field);
  };
  append(heads.clip_start);
  append(heads.clip_id);
  append(heads.crop);
  append(heads.task);
  for (const auto field : {&Clip::actions, &Clip::deltas, &Clip::c2w, &Clip::k, &Clip::object_px}) append_of_all(field);
  append(heads.outcome);
  for (const auto field : {&Clip::contact, &Clip::frames, &Clip::maps}) append_of_all(field);
  writer.Finish();
}

std::string PoseMapWords(const PoseMapOptions& options) {
  const nn::PoseMapConfig drawn{.drop_line_m = options.drop_line_m, .tool_length_m = options.tool_length_m, .lag_frames = options.lag_frames};
  return fmt::format("radius_px={} thickness_px={}{}", options.radius_px, options.thickness_px, drawn.Differences());
}

}  // namespace evac
