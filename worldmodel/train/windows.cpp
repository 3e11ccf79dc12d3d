#include "worldmodel/train/windows.h"

#include <algorithm>

namespace evac::train {
namespace {

bool HasContact(const Shard& shard, const Clip& clip, std::int64_t from, std::int64_t count) {
  const std::uint8_t* contact = shard.contact.data_ptr<std::uint8_t>() + clip.first + from;
  return std::any_of(contact, contact + count, [](std::uint8_t value) { return value != 0; });
}

/// The frames of a clip at which a hand is told to close beyond half, from below it.
std::vector<std::int64_t> Closings(const Shard& shard, const Clip& clip) {
  constexpr float kHalfClosed = 60;  // 0 open … 120 closed
  const Tensor actions = shard.actions.narrow(0, clip.first, clip.frames).to(at::kFloat).contiguous();
  const float* numbers = actions.data_ptr<float>();
  std::vector<std::int64_t> frames;
  for (std::int64_t frame = 1; frame < clip.frames; ++frame) {
    for (const std::int64_t hand : {7, 15}) {
      if (numbers[16 * frame + hand] > kHalfClosed && numbers[16 * (frame - 1) + hand] <= kHalfClosed)
        frames.push_back(frame);
    }
  }
  return frames;
}

}  // namespace

std::vector<std::int64_t> RolloutMemory(std::int64_t last, std::int64_t memory) {
  const std::int64_t frames = memory + last;  // the history: N times frame 0, then 1 … last
  std::vector<std::int64_t> picked;
  for (std::int64_t j = 0; j + 1 < memory; ++j)
    picked.push_back(std::max<std::int64_t>(0, frames * j / (memory - 1) - (memory - 1)));
  picked.push_back(last);
  return picked;
}

WindowSampler::WindowSampler(const ShardSet& shards, const WindowOptions& options) : options_(options) {
  if (options.memory < 1 || options.chunk < 1 || options.history < options.memory)
    throw TensorError("windows: memory " + std::to_string(options.memory) + ", chunk " + std::to_string(options.chunk) +
                      ", history " + std::to_string(options.history) + ", wanted 1 <= memory <= history, 1 <= chunk");
  if (!(options.failure_weight > 0))
    throw TensorError("windows: failure_weight " + std::to_string(options.failure_weight) + ", wanted above 0");
  for (const Clip& clip : shards.clips()) {
    if (!options.successes_only || clip.outcome == 1) AddClip(shards, clip);
  }
  if (any_.empty())
    throw TensorError("no clip of " + shards.shards().front().path.parent_path().string() + " has " +
                      std::to_string(options.chunk + 1) + " frames" +
                      (options.successes_only ? " and ended in success" : ""));
}

void WindowSampler::AddClip(const ShardSet& shards, const Clip& clip) {
  const Shard& shard = shards.shards()[clip.shard];
  const std::vector<std::int64_t> closings = Closings(shard, clip);
  const std::int64_t half = options_.chunk / 2;
  for (std::int64_t last = 0; last + options_.chunk < clip.frames; ++last) {
    const bool closes = std::any_of(closings.begin(), closings.end(),
                                    [&](std::int64_t frame) { return frame > last - half && frame <= last + half; });
    const bool starts = last % options_.chunk == 0, touches = HasContact(shard, clip, last + 1, options_.chunk);
    any_.push_back({&clip, last});
    if (starts) rollout_.push_back({&clip, last});
    if (touches) any_contact_.push_back({&clip, last});
    if (starts && touches) rollout_contact_.push_back({&clip, last});
    if (closes) any_closing_.push_back({&clip, last});
    if (starts && closes) rollout_closing_.push_back({&clip, last});
  }
}

std::vector<std::int64_t> WindowSampler::RandomMemory(std::int64_t last, Dice& dice) const {
  std::vector<std::int64_t> back;  // how many frames before the newest, distinct
  while (static_cast<std::int64_t>(back.size()) + 1 < options_.memory) {
    const std::int64_t steps = 1 + dice.Below(options_.history - 1);
    if (std::find(back.begin(), back.end(), steps) == back.end()) back.push_back(steps);
  }
  std::sort(back.rbegin(), back.rend());
  std::vector<std::int64_t> picked;
  for (const std::int64_t steps : back) picked.push_back(std::max<std::int64_t>(0, last - steps));
  picked.push_back(last);
  return picked;
}

const WindowSampler::Start& WindowSampler::PickStart(const std::vector<Start>& pool, Dice& dice) const {
  const double failed = std::min(1.0, options_.failure_weight), other = std::min(1.0, 1 / options_.failure_weight);
  constexpr int kMostDraws = 1000;  // a pool of the rarer kind alone
  for (int draw = 1;; ++draw) {
    const Start& start = pool[static_cast<std::size_t>(dice.Below(static_cast<std::int64_t>(pool.size())))];
    const double kept = start.clip->outcome == 0 ? failed : other;
    if (kept >= 1 || draw == kMostDraws || dice.Chance(kept)) return start;
  }
}

Window WindowSampler::Pick(Dice& dice) const {
  const bool rollout = dice.Chance(options_.rollout_share), contact = dice.Chance(options_.contact_share);
  const std::vector<Start>* pool = rollout ? &rollout_ : &any_;
  const std::vector<Start>& touching = rollout ? rollout_contact_ : any_contact_;
  if (contact && !touching.empty()) pool = &touching;
  const std::vector<Start>& closing = rollout ? rollout_closing_ : any_closing_;
  if (options_.closing_share > 0 && dice.Chance(options_.closing_share) && !closing.empty()) pool = &closing;
  const Start& start = PickStart(*pool, dice);
  Window window{start.clip, {}, start.last, options_.chunk, 0};
  window.memory = rollout ? RolloutMemory(start.last, options_.memory) : RandomMemory(start.last, dice);
  const auto any = static_cast<std::size_t>(dice.Below(options_.memory));
  window.image = window.memory[options_.first_image ? 0 : any];
  return window;
}

std::vector<Window> WindowSampler::Spread(std::int64_t count) const {
  std::vector<Window> windows;
  const auto all = static_cast<std::int64_t>(rollout_.size());
  for (std::int64_t i = 0; i < std::min(count, all); ++i) {
    const Start& start = rollout_[static_cast<std::size_t>(i * all / std::min(count, all))];
    windows.push_back({start.clip, RolloutMemory(start.last, options_.memory), start.last, options_.chunk, 0});
  }
  return windows;
}

}  // namespace evac::train
