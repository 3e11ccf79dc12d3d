#include <array>
#include <cstdio>
#include <span>
#include <vector>

#include "core/collection.h"
#include "core/file.h"
#include "core/npy.h"
#include "core/store.h"
#include "core/store_codec.h"
#include "core/store_study.h"
#include "core/tensor_file.h"
#include "policies/learned_input.h"
#include "policies/messages.h"
#include "tests/fuzz/small_recipe.h"
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

/// A study of one clip, which one rater has judged (study_fuzz.cpp).
void MakeStudySeed(const fs::path& folder) {
  const fs::path place = folder / "study";
  {
    evac::StudyStore study = evac::StudyStore::Create(
        place, {.name = "fuzz", .seed = 7, .width_px = 8, .height_px = 8, .evac_version = "0"});
    evac::StudyClip clip;
    clip.run = "run", clip.episode = "e", clip.task = "take_bottle", clip.policy = "hold", clip.world = "real";
    clip.rubric_hash = "h", clip.views = "[]", clip.file = "clips/a.mp4", clip.frames = 4;
    const evac::StudyRubric rubric{"h", "take_bottle", "{}"};
    study.AddWave({&clip, 1}, {&rubric, 1});
    study.AddInvite("link", evac::RaterRole::kRater, 1);
    const evac::StudyRater rater = study.Join("link", "uuid", "Ann", 2);
    study.AddSession(rater.id, "session", 2);
    evac::Presentation shown;
    shown.id = "p", shown.rater = rater.id, shown.clip = 1;
    study.AddPresentations({&shown, 1});
    evac::HumanVerdict verdict;
    verdict.client_uuid = "u", verdict.presentation = "p", verdict.label = "failure", verdict.note = "slipped";
    study.AddVerdict(verdict);
    study.AddGuess(rater.id, 1, "unsure", 3);
  }
  evac::WriteText(folder / "database", evac::ReadFile(place / "study.sqlite"));
  fs::remove_all(place);
}

/// One of each message without its type's fingerprint, and a change of a JPEG, each after the number that says which it
/// is (lcm_messages_fuzz.cpp).
void MakeMessageSeeds(const fs::path& folder) {
  const auto seed = [&](const char* name, const char kind, const auto& message) {
    const std::vector<std::uint8_t> bytes = evac::Encoded(message);
    evac::WriteText(folder / name, kind + std::string(bytes.begin() + 8, bytes.end()));
  };
  const evac::Task task = SomeTask();
  evac::chunk_t chunk{};
  chunk.targets.assign(2, evac::ToWire(evac::Arms(1)));
  chunk.num_targets = 2, chunk.num_arms = 1;
  seed("chunk", 0, chunk);
  evac::image_t image{};
  image.camera = "head";
  evac::PutImage(cv::Mat(8, 8, CV_8UC3, cv::Scalar(10, 120, 200)), std::nullopt, image);
  seed("image", 1, image);
  evac::observation_t observation{};
  observation.arms = evac::ToWire(evac::Arms(1));
  observation.cameras = {evac::ToWire(task.cameras[0])};
  observation.num_arms = observation.num_images = 1;
  seed("observation", 2, observation);
  evac::episode_start_t start{};
  evac::PutTask(task, start);
  seed("start", 3, start);
  evac::hello_t hello{};
  hello.harness = evac::ToWire(evac::HarnessSpec(task, 2));
  seed("hello", 4, hello);
  evac::declaration_t declaration{};
  const evac::PolicySpec hold{
      .name = "hold", .checkpoint = "a", .arms = {"right"}, .cameras = {{"head"}}, .needs = {"images"}};
  declaration.policy = evac::ToWire(hold);
  seed("declaration", 5, declaration);
  evac::episode_started_t started{};
  started.error = "no";
  seed("started", 6, started);
  evac::bye_t bye{};
  bye.client = "somebody";
  seed("bye", 7, bye);
  evac::WriteText(folder / "jpeg", std::string("\x08\x01\x40\x7f", 4));
}

/// A recipe with the pages it names, each after the letter that says which it is (collect_recipe_fuzz.cpp).
void MakeRecipeSeeds(const fs::path& corpus) {
  for (const RecipePage& page : kRecipePages)
    evac::WriteText(corpus / "collect_recipe_fuzz" / page.file, page.letter + std::string(page.text));
}

/// What people and their browsers write: tables, a server's page, answers.
void MakeTextSeeds(const fs::path& corpus) {
  evac::WriteText(corpus / "rating_csv_fuzz/small.csv",
                  "run,episode,rater,label,note\na,e,ann,S,\nb,e,ann,failure,\"slipped, late\"\na,f,bo,U,\n");
  evac::WriteText(corpus / "pairs_csv_fuzz/small.csv",
                  "group,task,policy,real_sr,sim_sr\na,take,p,0.8,0.7\na,take,q,0.5,0.6\na,take,\"r, s\",0.2,0.1\n");
  evac::WriteText(corpus / "real_trials_csv_fuzz/small.csv",
                  "task,initial_state,policy,checkpoint,outcome,trial,video\ntake,41-0001,p,c,success,1,a.mp4\n"
                  "t,1,p,,0,,\n");
  evac::WriteText(corpus / "training_tables_fuzz/small.csv", "step,loss\n1,0.5\n2,0.25\n200,nan\n");
  evac::WriteText(corpus / "training_job_fuzz/small",
                  "evac-training 1\nworld\nsize chunk 8\nsize unet.channel_mult 1,2,4,4\noption batch 4\ninit_widen true\n"
                  "init_sha256 a\nrecipe b,b\nbegun_with x\n");
  evac::WriteText(corpus / "vlm_config_fuzz/server.yaml",
                  "name: qwen3-vl\nbase_url: http://localhost:8000/v1\nmodel: m\nkey: {env: KEY}\n"
                  "sampling: {temperature: 0.1, seed: 7, max_tokens: 500}\nclip: {frames: 8, tail_frames: 2}\n"
                  "timeouts: {total_s: 60}\nbudget: {max_usd: 2, usd_per_million_prompt_tokens: 0.5}\n");
  const std::string id(32, 'a');
  const std::pair<const char*, std::string> words[] = {
      {"verdict", R"({"client_uuid": "0123456789abcdef", "presentation": ")" + id +
                      R"(", "tab_epoch": 3, "label": "success", "coverage": 0.9, "stages": 5, "played": [[0, 1.5]]})"},
      {"join", R"({"invite": ")" + id + R"(", "uuid": ")" + id + R"(", "name": "Ann"})"},
      {"next", R"({"tab_epoch": 3, "held": [")" + id + R"("]})"},
      {"guess", R"({"presentation": ")" + id + R"(", "guess": "unsure"})"},
      {"range", "bytes=5-9"},
      {"cookie", "a=b; evac_rating=" + id},
      {"from", "from=200"}};
  for (const auto& [name, text] : words) evac::WriteText(corpus / "rating_words_fuzz" / name, text);
}

/// The project's own pages, of suites each after the letter that says what it is (suite_fuzz.cpp).
void MakePageSeeds(const fs::path& corpus) {
  const fs::path root = EVAC_SOURCE_DIR, folder = corpus / "suite_fuzz";
  for (const char* sizes : {"evac_published.yaml", "desk_model.yaml"})
    evac::WriteText(corpus / "evac_config_fuzz" / sizes, evac::ReadFile(root / "apps/configs" / sizes));
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

/// A small network's weights, and a chunk of two frames of one view.
void MakeTensorSeeds(const fs::path& corpus) {
  const std::array<float, 2> numbers = {1.5F, -2};
  const std::array<std::uint8_t, 2 * 2 * 3 * 3> pixels{};
  const evac::TensorView bias{{"out.bias", evac::TensorType::kF32, {2}}, std::as_bytes(std::span(numbers))};
  const evac::TensorView chunk[] = {
      {{"latents", evac::TensorType::kF32, {2, 1}}, std::as_bytes(std::span(numbers))},
      {{"pictures", evac::TensorType::kU8, {2, 1, 2, 3, 3}}, std::as_bytes(std::span(pixels))}};
  for (const char* target : {"weight_file_fuzz", "tensor_file_fuzz", "chunk_cache_fuzz"})
    fs::create_directories(corpus / target);
  const evac::TensorMetadata card = {{"format", "fuzz 1"},
                                     {"tasks", "a,b"},
                                     {"threshold", "0.25"},
                                     {"frames", "4"},
                                     {"camera.head", evac::CardLine(SomeTask().cameras[0])}};
  for (const char* target : {"weight_file_fuzz", "tensor_file_fuzz"})
    evac::WriteTensorFile(corpus / target / "small", {&bias, 1}, card);
  evac::WriteTensorFile(corpus / "chunk_cache_fuzz/small", chunk, {});
}

/// What a training is told by its page and by --set, what it leaves to go on from, and what `evac imagine` does.
void MakeJobSeeds(const fs::path& corpus) {
  const std::string page = evac::ReadFile(EVAC_SOURCE_DIR "/apps/configs/desk_training.yaml");
  evac::WriteText(corpus / "training_page_fuzz/desk", "\n" + page);
  evac::WriteText(corpus / "training_page_fuzz/set", "optimiser=muon\n" + page);
  evac::WriteText(corpus / "training_page_fuzz/world",
                  "view_weights=1,0.25\nworld: {steps: 3, minutes: 0.5, seed: 18446744073709551615, drop: 1e-3, "
                  "successes_only: true, memory_noise_kind: uniform, step_weight: min_snr}\n");
  evac::WriteText(corpus / "imagined_page_fuzz/finished.json",
                  R"({"job": {"eta": 1.0, "reference_quirks": {"residual_noise": false}, "seed": 9, "solver": "ddim",
 "statistics": {"mean": [0.0, 0.5]}}, "finished": true, "frames": 7, "command": ["evac", "imagine"]})");
  const std::array<float, 6> numbers = {0, 1.5F, -2, 1e-3F, 4, 0.25F};
  std::vector<evac::TensorView> tensors;
  for (const char* name : {"values", "first_moment", "second_moment", "average", "best"})
    tensors.push_back({{name, evac::TensorType::kF32, {6}}, std::as_bytes(std::span(numbers))});
  const evac::TensorMetadata metadata = {{"format", "own"},        {"layout", "own"},        {"identity", "own"},
                                         {"step", "3"},            {"steps", "10"},          {"planned", "1"},
                                         {"minutes", "0x1p+0"},    {"not_finite", "0"},      {"left_out", "1"},
                                         {"smooth_loss", "-nan"},  {"best_score", "0x1p-3"}, {"best_step", "2"},
                                         {"holdouts_since_best", "1"}};
  fs::create_directories(corpus / "training_checkpoint_fuzz");
  evac::WriteTensorFile(corpus / "training_checkpoint_fuzz/planned", tensors, metadata);
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
  MakeStudySeed(corpus / "study_fuzz");
  MakeMessageSeeds(corpus / "lcm_messages_fuzz");
  MakeRecipeSeeds(corpus);
  MakeTextSeeds(corpus);
  MakePageSeeds(corpus);
  MakeShardSeeds(corpus / "shards_fuzz");
  MakeTensorSeeds(corpus);
  MakeJobSeeds(corpus);
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
  return 0;  // tests/corpus calls this by another name
}
