#include "core/recording_writer.h"

#include <nlohmann/json.hpp>

#include "core/error.h"
#include "core/file.h"
#include "core/geometry.h"
#include "core/recording.h"
#include "core/recording_parts.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

std::string IntrinsicsPage(const Camera& camera, int scale) {
  const Json intrinsic = {{"fx", camera.fx_px * scale},
                          {"fy", camera.fy_px * scale},
                          {"ppx", camera.cx_px * scale},
                          {"ppy", camera.cy_px * scale}};
  return Json{{"intrinsic", intrinsic}}.dump() + "\n";
}

Json PoseEntry(const Eigen::Isometry3d& base_from_camera) {
  Json rows = Json::array();
  for (int row = 0; row < 3; ++row) {
    const Eigen::RowVector3d values = base_from_camera.linear().row(row);
    rows.push_back({values[0], values[1], values[2]});
  }
  const Eigen::Vector3d at = base_from_camera.translation();
  return {{"extrinsic", {{"rotation_matrix", rows}, {"translation_vector", {at[0], at[1], at[2]}}}}};
}

std::string ExtrinsicsPage(const Camera& camera, const std::vector<Arms>& arms) {
  Json list = Json::array();
  for (const Arms& now : arms) list.push_back(PoseEntry(BaseFromCamera(camera, now)));
  return list.dump() + "\n";
}

void WriteVideo(const fs::path& path, const RecordedEpisode& episode, std::size_t view, const RecordingVideo& video) {
  VideoWriter writer(path,
                     {.period_s = episode.period_s, .crf = video.crf, .preset = video.preset, .scale = video.scale});
  for (const std::vector<cv::Mat>& pictures : episode.pictures) writer.Append(pictures[view]);
  writer.Finish();
}

void CheckLengths(const TreePlace& place, const RecordedEpisode& episode) {
  const std::size_t steps = episode.arms.size();
  const bool told_fits = episode.told.empty() || episode.told.size() == steps;
  if (steps > 0 && told_fits && episode.pictures.size() == steps) return;
  throw InternalError("{}: {} measured steps, {} told, {} pictures; wanted the same", place.Folder().string(), steps,
                      episode.told.size(), episode.pictures.size());
}

const char* NameOf(Mount mount) {
  if (mount == Mount::kBase) return "base";
  return mount == Mount::kLeftGripper ? "left_gripper" : "right_gripper";
}

}  // namespace

void CheckReadableCameras(const std::vector<Camera>& cameras, std::size_t arms, const std::string& where) {
  bool has_head = false;
  for (const Camera& camera : cameras) {
    has_head |= camera.name == "head";
    const Mount read = MountOf(camera.name, arms);
    if (camera.mount == read) continue;
    throw InvalidInput("{}: camera '{}' is mounted on {}, a recording's camera of that name is read as on {}: wanted "
                       "hand_left on the left gripper, hand_right on the right one, other names on the base",
                       where, camera.name, NameOf(camera.mount), NameOf(read));
  }
  if (!has_head) throw InvalidInput("{}: found no camera 'head', wanted one: no recording is read without it", where);
}

void WriteRecording(const TreePlace& place, const RecordedEpisode& episode, const RecordingVideo& video) {
  CheckLengths(place, episode);
  CheckReadableCameras(episode.cameras, episode.arms.front().size(), place.Folder().string());
  const fs::path videos = place.Folder() / "videos";
  const fs::path pages = place.root / "parameters" / place.task / place.episode / "parameters" / "camera";
  const fs::path proprio = place.root / "proprio_stats" / place.task / place.episode;
  for (const fs::path& folder : {videos, pages, proprio}) MakeFolders(folder);
  for (std::size_t view = 0; view < episode.cameras.size(); ++view) {
    const Camera& camera = episode.cameras[view];
    WriteVideo(videos / (camera.name + "_color.mp4"), episode, view, video);
    WriteFileAtomically(pages / (camera.name + "_intrinsic_params.json"), IntrinsicsPage(camera, video.scale));
    WriteFileAtomically(pages / (camera.name + "_extrinsic_params_aligned.json"), ExtrinsicsPage(camera, episode.arms));
  }
  WriteFileAtomically(proprio / "proprio_stats.h5", ProprioBytes(episode.arms, episode.told));
}

}  // namespace evac
