#include <array>
#include <cstdio>
#include <span>

#include "core/collection.h"
#include "core/file.h"
#include "core/npy.h"
#include "core/store.h"
#include "core/store_codec.h"
#include "core/tensor_file.h"
#include "tests/fuzz/small_shards.h"
#include "tests/support/synthetic_recording.h"

namespace {

namespace fs = std::filesystem;

evac::Task SomeTask() {
  evac::Task task;
  task.id = "take_bottle";
  task.cameras.push_back(
      {.name = "head", .width_px = 8, .height_px = 8, .fx_px = 8, .fy_px = 8, .cx_px = 4, .cy_px = 4});
  task.rubric.stages.push_back(
      {.name = "reach", .all_of = {{.kind = "distance", .a = "gripper", .b = "bottle", .below = 0.2}}});
  return task;
}

/// A run with one of everything; each kind of bytes after the letter that says which it is (store_fuzz.cpp).
void MakeStoreSeeds(const fs::path& folder) {
  const auto seed = [&](const std::string& name, const char kind, const std::string& bytes) {
    evac::WriteText(folder / name, kind + bytes);
  };
  const evac::Task task = SomeTask();
  const cv::Mat image(8, 8, CV_8UC3, cv::Scalar(10, 120, 200));
  evac::Episode episode{
      .key = {{task.id, "1-0000", "hold", "a", 1}, "real"}, .stop = evac::StopReason::kStill, .stop_reason = "still"};
  episode.observations.assign(2, {.images = {}, .arms = evac::Arms(1)});
  episode.commands.assign(1, evac::Arms(1));
  const evac::PrivilegedTrack track(2, {.bodies = {{"bottle"}, {"table"}}, .contacts = {{"bottle", "table", 1}}});
  const fs::path run = folder / "run";
  {
    evac::Store store = evac::Store::CreateOrContinue(
        run, {.suite_text = "suite: t", .suite_hash = "h", .suite_path = "", .evac_version = "0"});
    store.AddTask(task);
    store.AddWorld({.name = "real", .type = "mujoco", .is_real = true, .profile_hash = ""});
    store.AddPolicy({"hold", "a", "{}"});
    store.Add({.episode = episode, .privileged = track, .video = {}, .thumbnail_jpeg = {}});
    store.AddInitialScene(episode.key.pair, {{image}, evac::Arms(1), task.cameras});
    store.AddVerdict({.episode_id = episode.key.Id(), .judge = "oracle", .label = evac::Label::kSuccess});
    store.Count("hold@a", {{"repeats", 3}});
  }
  seed("arms", 0, evac::codec::EncodeArms({{evac::Arms(2), true}}));
  seed("privileged", 1, evac::codec::EncodePrivileged(track));
  seed("cameras", 2, evac::codec::EncodeCameras(task.cameras));
  seed("task", 3, evac::codec::EncodeTask(task));
  seed("database", 4, evac::ReadFile(run / "evac.sqlite"));
  fs::remove_all(run);
  for (const char* target : {"png_fuzz", "recording_png_fuzz"})
    evac::WriteText(folder.parent_path() / target / "small.png", evac::codec::EncodePng(image));
}

/// The project's own pages, each after the letter that says what it is (suite_fuzz.cpp).
void MakePageSeeds(const fs::path& folder) {
  const fs::path root = EVAC_SOURCE_DIR;
  for (const char* suite : {"apps/configs/demo.yaml", "apps/configs/agibot_replay.yaml", "tests/system/faults.yaml"})
    evac::WriteText(folder / fs::path(suite).filename(), "1" + evac::ReadFile(root / suite));
  for (const auto& page : fs::directory_iterator(root / "worldmodel/sim/scenes")) {
    if (page.path().extension() == ".yaml")
      evac::WriteText(folder / page.path().filename(), "0" + evac::ReadFile(page.path()));
  }
}

/// One of each file of a packing, after the number that says which it is (shards_fuzz.cpp), and a first shard held out.
void MakeShardSeeds(const fs::path& folder) {
  const fs::path packing = folder / "packing";
  const auto seed = [&](const char* name, const char kind, const char* file) {
    evac::WriteText(folder / name, kind + evac::ReadFile(packing / file));
  };
  WriteSmallShards(packing, "holdout");
  seed("holdout", 0, "shard_00000.safetensors");
  WriteSmallShards(packing);
  seed("train", 0, "shard_00000.safetensors");
  seed("latents", 1, "latents_00000.safetensors");
  seed("variants", 2, "variants_00000.safetensors");
  seed("list", 3, "shards.json");
  fs::remove_all(packing);
}

/// A small network's weights, a chunk of two frames of one view, and a sheet of verdicts.
void MakeTensorSeeds(const fs::path& corpus) {
  const std::array<float, 2> numbers = {1.5F, -2};
  const std::array<std::uint8_t, 2 * 2 * 3 * 3> pixels{};
  const evac::TensorView bias{{"out.bias", evac::TensorType::kF32, {2}}, std::as_bytes(std::span(numbers))};
  const evac::TensorView chunk[] = {
      {{"latents", evac::TensorType::kF32, {2, 1}}, std::as_bytes(std::span(numbers))},
      {{"pictures", evac::TensorType::kU8, {2, 1, 2, 3, 3}}, std::as_bytes(std::span(pixels))}};
  for (const char* target : {"weight_file_fuzz", "chunk_cache_fuzz"}) fs::create_directories(corpus / target);
  evac::WriteTensorFile(corpus / "weight_file_fuzz/small", {&bias, 1},
                        {{"format", "fuzz 1"}, {"tasks", "a,b"}, {"threshold", "0.25"}, {"frames", "4"}});
  evac::WriteTensorFile(corpus / "chunk_cache_fuzz/small", chunk, {});
  evac::WriteText(corpus / "rating_csv_fuzz/small.csv",
                  "run,episode,rater,label,note\na,e,ann,S,\nb,e,ann,failure,\"slipped, late\"\na,f,bo,U,\n");
}

/// CORPUS/npy_fuzz: one array per type. CORPUS/recording_fuzz: a camera's pages and a collection's row, each after the
/// letter that says which it is. CORPUS/proprio_fuzz and CORPUS/video_fuzz: a track and a video of four steps.
void MakeCorpus(const fs::path& corpus) {
  for (const std::string dtype : {"<f8", "<f4", "<i8", "<i4", "|u1"}) {
    evac::WriteText(corpus / "npy_fuzz" / dtype.substr(1), evac::NpyBytes({dtype, {2, 3}, {1, 2, 3, 4, 5, 6}}));
  }
  const fs::path clip = corpus / "clip";
  evac::SyntheticClip(4).Write(evac::OneFolder(clip));
  const auto seed = [&](const char* kind, const char* file) {
    evac::WriteText(corpus / "recording_fuzz" / file, kind + evac::ReadFile(clip / file));
  };
  seed("i", "head_intrinsic_params.json");
  seed("e", "head_extrinsic_params_aligned.json");
  evac::WriteText(corpus / "recording_fuzz/row.json",
                  "r" + evac::CollectedJson({.task = "take_bottle", .parameters = {{"noise_m", 0.01}}, .frames = 80}));
  for (const char* target : {"proprio_fuzz", "video_fuzz"}) fs::create_directories(corpus / target);
  fs::rename(clip / "proprio_stats.h5", corpus / "proprio_fuzz" / "four_steps.h5");
  fs::rename(clip / "head_color.mp4", corpus / "video_fuzz" / "four_frames.mp4");
  fs::remove_all(clip);
  MakeStoreSeeds(corpus / "store_fuzz");
  MakePageSeeds(corpus / "suite_fuzz");
  MakeShardSeeds(corpus / "shards_fuzz");
  MakeTensorSeeds(corpus);
  fs::create_directories(corpus / "truth_fuzz");
  evac::WriteTruth(corpus / "truth_fuzz/three_frames", {{"head"}, std::vector<float>(6, 1), std::vector<std::uint8_t>(3, 0)});
  evac::WriteText(corpus / "scene_files_fuzz/desk.xml",
                  "<mujoco><compiler meshdir='.'/><include file=\"scene.xml\"/><mesh file = 'a.obj'/></mujoco>");
  evac::WriteText(corpus / "weights_card_fuzz/desk",
                  "0.1\n" + evac::ReadFile(EVAC_SOURCE_DIR "/worldmodel/weights/desk/statistics.yaml"));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fputs("usage: make_corpus FOLDER\n", stderr);
    return 2;
  }
  MakeCorpus(argv[1]);
}
