#include "apps/networks/policy_training.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "apps/networks/shard_rows.h"
#include "core/error.h"
#include "core/geometry.h"
#include "core/names.h"
#include "core/recording.h"
#include "policies/learned_input.h"
#include "worldmodel/train/option_limits.h"

namespace evac {
namespace {

enum Stream : std::uint32_t { kPick = 21, kChange = 22, kArms = 23 };

constexpr const char* kTraining = "policy training";
constexpr double kGrasps = 0.5;
constexpr double kNear_m = 0.05;  // an error of position that weighs as much as a hand that does not close

at::Tensor ActionsOf(const std::filesystem::path& shard) {
  const nn::MappedTensors file(TensorFile::Open(shard));
  const at::Tensor actions = file.Get("actions");
  nn::CheckShape(shard.string() + ": actions", actions, {-1, 16});
  return actions.to(at::kFloat).clone();
}

Eigen::Isometry3d PoseFrom(const at::Tensor& c2w) {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  const auto* numbers = c2w.data_ptr<float>();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) pose(row, column) = numbers[4 * row + column];
  }
  return pose;
}

/// One row of `actions`: the arm that carries a camera. @param mount  not kBase
ArmState CarrierOf(const float* row, Mount mount) { return ArmOf(row + (mount == Mount::kLeftGripper ? 0 : 8)); }

/// A clip that shows all that its camera saw: its crop begins in the corner and is the largest of its recording's.
const PackedClip& WholePicture(const PackedSet& set) {
  std::vector<at::Tensor> of_shards;
  for (const train::Shard& shard : set.shards.shards()) {
    const nn::MappedTensors file(TensorFile::Open(shard.path));
    of_shards.push_back(file.Get("crop").to(at::kLong).clone());
    nn::CheckShape(shard.path.string() + ": crop", of_shards.back(), {shard.clip_start.size(0) - 1, 4});
  }
  const at::Tensor crops = at::cat(of_shards);  // [clips, 4]: x, y, width, height
  const auto recording = [&](std::size_t clip) {
    return std::pair(set.shards.shards()[set.clips[clip].shard].path.parent_path(), set.clips[clip].recording);
  };
  const auto crop = [&](std::size_t clip) { return crops.data_ptr<std::int64_t>() + 4 * clip; };
  std::map<std::pair<std::filesystem::path, std::int64_t>, std::int64_t> largest_px2;
  for (std::size_t i = 0; i < set.clips.size(); ++i) {
    std::int64_t& largest = largest_px2[recording(i)];
    largest = std::max(largest, crop(i)[2] * crop(i)[3]);
  }
  for (std::size_t i = 0; i < set.clips.size(); ++i) {
    const bool is_whole = crop(i)[0] == 0 && crop(i)[1] == 0 && crop(i)[2] * crop(i)[3] == largest_px2[recording(i)];
    if (is_whole) return set.clips[i];
  }
  throw InvalidInput("policy training: none of {} clips shows a whole picture, wanted crop 0 of a recording as `evac "
                     "pack` makes it: it says what the cameras are",
                     set.clips.size());
}

bool HoldsContact(const train::Shard& shard, std::int64_t first, std::int64_t end) {
  const auto* contact = shard.contact.data_ptr<std::uint8_t>();
  return std::any_of(contact + first, contact + end, [](std::uint8_t c) { return c != 0; });
}

/// Successes of the behaviours that are wanted; where all are, demonstrations too that nobody gave an outcome, as a
/// robot's recordings are. Failures never.
bool IsImitated(const PackedClip& clip, const std::set<std::string>& wanted) {
  if (clip.frames < 2 || clip.outcome == 0) return false;
  return wanted.empty() || (clip.outcome == 1 && wanted.contains(clip.behaviour));
}

/// @throws InvalidInput: none of the clips is imitated.
[[noreturn]] void RefuseToImitateNothing(const PackedSet& set, const std::string& behaviours) {
  const bool measures = set.shards.split() == train::Split::kHoldout;
  const std::string of = measures ? " of the hold-out of " + set.shards.FolderNames() : "";
  const char* wanted = measures ? "; wanted a larger `evac pack --holdout`, or another --seed" : "";
  if (NamesIn(behaviours).empty())
    throw InvalidInput("policy training: each of {} clips{} is a failure or has a single frame{}", set.clips.size(), of,
                       wanted);
  const bool robots = std::ranges::any_of(set.clips, [](const PackedClip& clip) { return clip.outcome < 0; });
  throw InvalidInput("policy training: none of {} clips{} is a success of behaviours '{}'{}{}", set.clips.size(), of,
                     behaviours, wanted,
                     robots ? "; a robot's recordings have no behaviour and no outcome: all are imitated with "
                              "`behaviours: \"\"`"
                            : "");
}

}  // namespace

train::Settings SettingsOf(PolicyOptions& options) {
  train::Settings settings = {{"batch", &options.batch},
                              {"behaviours", &options.behaviours},
                              {"contact_share", &options.contact_share},
                              {"arm_noise_m", &options.arm_noise_m},
                              {"object_weight", &options.object_weight},
                              {"reconstructed_share", &options.reconstructed_share},
                              {"light", &options.changes.light},
                              {"offset", &options.changes.offset},
                              {"blur_share", &options.changes.blur_share},
                              {"blur_times", &options.changes.blur_times}};
  const train::Settings shared = SettingsOf(options.job.trainer);
  settings.insert(settings.end(), shared.begin(), shared.end());
  return settings;
}

Eigen::Isometry3d ToldCamera(const train::Shard& shard, std::int64_t clip_first, std::int64_t row, std::int64_t view,
                             Mount mount) {
  if (mount == Mount::kBase) return PoseFrom(shard.c2w[clip_first + row][view]);
  const auto told = [&](std::int64_t at) {
    const at::Tensor numbers = shard.actions[at].to(at::kFloat).contiguous();
    return CarrierOf(numbers.data_ptr<float>(), mount).base_from_gripper;
  };
  return told(clip_first + row) * told(clip_first).inverse() * PoseFrom(shard.c2w[clip_first][view]);
}

std::vector<std::string> ArmsOf(const PackedSet& set) { return NamesIn(set.shards.metadata().at("arms")); }

PolicyTraining::PolicyTraining(const PackedSet& set, const PolicyOptions& options, const ShardCodec* codec)
    : set_(set), options_(options), codec_(codec), arms_(ArmsOf(set)) {
  if (options.batch < 1) throw InvalidInput("policy training: batch is {}, wanted at least 1", options.batch);
  train::RequireShares(kTraining, {{"contact_share", options.contact_share},
                                   {"reconstructed_share", options.reconstructed_share}});
  train::RequireWeights(kTraining, {{"arm_noise_m", options.arm_noise_m}, {"object_weight", options.object_weight}});
  CheckChanges(kTraining, options.changes);
  const std::vector<std::string> names = NamesIn(options.behaviours);
  const std::set<std::string> wanted(names.begin(), names.end());
  for (const train::Shard& shard : set.shards.shards()) actions_.push_back(ActionsOf(shard.path));
  for (std::size_t i = 0; i < set.clips.size(); ++i) {
    const PackedClip& clip = set.clips[i];
    if (!IsImitated(clip, wanted)) continue;
    imitated_.push_back(i);
    for (std::int64_t row = 0; row + 1 < clip.frames; ++row) {
      const std::int64_t end = std::min(row + kLearnedChunk, clip.frames - 1) + 1;
      if (HoldsContact(set.shards.shards()[clip.shard], clip.first + row, clip.first + end))
        contacts_.push_back({i, row});
    }
  }
  if (imitated_.empty()) RefuseToImitateNothing(set, options.behaviours);
}

Arms PolicyTraining::ArmsAt(const PackedClip& clip, std::int64_t row) const {
  const float* numbers = actions_[clip.shard].data_ptr<float>() + 16 * (clip.first + std::min(row, clip.frames - 1));
  return ArmsOfRow(numbers, arms_.size());
}

Moment PolicyTraining::Draw(train::Dice& dice) const {
  if (!contacts_.empty() && dice.Chance(options_.contact_share))
    return contacts_[static_cast<std::size_t>(dice.Below(static_cast<std::int64_t>(contacts_.size())))];
  const std::size_t clip = imitated_[static_cast<std::size_t>(dice.Below(static_cast<std::int64_t>(imitated_.size())))];
  return {clip, dice.Below(set_.clips[clip].frames - 1)};
}

void PolicyTraining::PutMoment(const Moment& moment, std::int64_t b, Batch& batch) const {
  const PackedClip& clip = set_.clips[moment.clip];
  const train::Shard& shard = set_.shards.shards()[clip.shard];
  const std::int64_t row = clip.first + moment.row;
  for (std::int64_t v = 0; v < set_.shards.views(); ++v) {
    const Mount mount = MountOf(set_.cameras[static_cast<std::size_t>(v)], arms_.size());
    PutRays(CameraAt(shard, row, v), ToldCamera(shard, clip.first, moment.row, v, mount),
            batch.input.rays[b][v].data_ptr<float>(), batch.input.eyes[b][v].data_ptr<float>());
  }
  const Arms now = ArmsAt(clip, moment.row);
  for (std::size_t a = 0; a < arms_.size(); ++a) {
    const auto arm = static_cast<std::int64_t>(a);
    PutArm(now[a], batch.input.arms[b][arm].data_ptr<float>());
    for (std::int64_t k = 0; k < kLearnedChunk; ++k)
      PutArm(ArmsAt(clip, moment.row + 1 + k)[a], batch.targets[b][k][arm].data_ptr<float>());
    for (std::int64_t before = 0; before <= moment.row; ++before) {
      if (ArmsAt(clip, before)[a].closure > kGrasps) batch.input.grasped[b][arm] = 1;
    }
  }
  batch.input.task[b] = clip.task;
}

at::Tensor PolicyTraining::Seen(const Moment& moment) const {
  const PackedClip& clip = set_.clips[moment.clip];
  const train::Shard& shard = set_.shards.shards()[clip.shard];
  const std::int64_t row = clip.first + moment.row;
  return moment.is_reconstructed ? codec_->Reconstructed(shard, {row}).select(1, 0) : shard.frames[row];
}

PolicyTraining::Batch PolicyTraining::BatchOf(const std::vector<Moment>& moments) const {
  const auto b = static_cast<std::int64_t>(moments.size()), v = set_.shards.views(),
             a = static_cast<std::int64_t>(arms_.size());
  Batch batch{{{},
               at::empty({b, v, 3, 3}),
               at::empty({b, v, 3}),
               at::empty({b, a, kArmNumbers}),
               at::zeros({b, a}),
               at::zeros({b}, at::kLong)},
              at::empty({b, kLearnedChunk, a, kArmNumbers}),
              {},
              {}};
  std::vector<at::Tensor> pictures, objects;
  for (std::int64_t i = 0; i < b; ++i) {
    const Moment& moment = moments[static_cast<std::size_t>(i)];
    const PackedClip& clip = set_.clips[moment.clip];
    const train::Shard& shard = set_.shards.shards()[clip.shard];
    pictures.push_back(Seen(moment));
    objects.push_back(shard.object_px[clip.first + moment.row]);
    PutMoment(moment, i, batch);
  }
  batch.input.pictures = at::stack(pictures).to(at::kFloat) / 127.5 - 1;
  const auto size =
      at::tensor({static_cast<float>(set_.shards.width_px()), static_cast<float>(set_.shards.height_px())});
  const at::Tensor object = at::stack(objects) / size;
  batch.visible = ((object >= 0) * (object <= 1)).all(-1).to(at::kFloat);  // 0 where it is not a number
  batch.object = object.nan_to_num(0).clamp(0, 1);
  return batch;
}

/// Mean absolute error, positions in units of kNear_m.
at::Tensor PolicyTraining::Distance(const LearnedOutput& output, const Batch& batch) const {
  const at::Tensor off = (output.targets - batch.targets).abs();
  return (off.narrow(-1, 0, 3) / kNear_m).sum(-1).mean() + off.narrow(-1, 3, 6).sum(-1).mean() +
         off.narrow(-1, 9, 1).mean();
}

at::Tensor PolicyTraining::Loss(const LearnedNet& net, const train::StepPlace& place) const {
  train::Dice pick(place, kPick), change(place, kChange), arms(place, kArms);
  std::vector<Moment> moments;
  for (std::int64_t i = 0; i < options_.batch; ++i) {
    moments.push_back(Draw(pick));
    if (codec_) moments.back().is_reconstructed = change.Chance(options_.reconstructed_share);
  }
  Batch batch = BatchOf(moments);
  batch.input.pictures = Changed(batch.input.pictures, options_.changes, change);
  at::Tensor xyz_m = batch.input.arms.narrow(-1, 0, 3);
  xyz_m += arms.Normal(xyz_m.sizes()) * options_.arm_noise_m;
  const LearnedOutput output = net(batch.input);
  const at::Tensor off = (output.object - batch.object).abs().sum(-1) * batch.visible;
  return Distance(output, batch) + options_.object_weight * off.sum() / (batch.visible.sum() + 1e-6);
}

double PolicyTraining::Measure(const LearnedNet& net, std::int64_t moments) const {
  const at::NoGradGuard no_gradients;
  double sum = 0;
  std::int64_t done = 0;
  while (done < moments) {
    std::vector<Moment> some;
    for (; done < moments && static_cast<std::int64_t>(some.size()) < options_.batch; ++done) {
      const std::size_t clip = imitated_[static_cast<std::size_t>(done) % imitated_.size()];
      some.push_back({clip, (done * 37) % (set_.clips[clip].frames - 1)});
    }
    const Batch batch = BatchOf(some);
    sum += Distance(net(batch.input), batch).item<double>() * static_cast<double>(some.size());
  }
  return sum / static_cast<double>(moments);
}

std::vector<Camera> CamerasOf(const PackedSet& set) {
  const PackedClip& clip = WholePicture(set);
  const train::Shard& shard = set.shards.shards()[clip.shard];
  const at::Tensor actions = ActionsOf(shard.path);
  std::vector<Camera> cameras;
  for (std::size_t v = 0; v < set.cameras.size(); ++v) {
    Camera camera = CameraAt(shard, clip.first, static_cast<std::int64_t>(v));
    camera.name = set.cameras[v];
    camera.mount = MountOf(camera.name, ArmsOf(set).size());
    const Eigen::Isometry3d base_from_camera = PoseFrom(shard.c2w[clip.first][static_cast<std::int64_t>(v)]);
    const float* told = actions.data_ptr<float>() + 16 * clip.first;
    camera.mount_from_camera = camera.mount == Mount::kBase
                                   ? base_from_camera
                                   : CarrierOf(told, camera.mount).base_from_gripper.inverse() * base_from_camera;
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace evac
