#include "worldmodel/train/windows.h"

#include <algorithm>

#include "worldmodel/nn/hand_turns.h"
#include "worldmodel/train/option_limits.h"

namespace evac::train {
namespace {

bool HasContact(const Shard& shard, const Clip& clip, std::int64_t from, std::int64_t count) {
  const std::uint8_t* contact = shard.contact.data_ptr<std::uint8_t>() + clip.first + from;
  return std::any_of(contact, contact + count, [](std::uint8_t value) { return value != 0; });
}

/// The frames of a clip at which a hand is told to close beyond half, from below it, and to open.
struct Turns {
  std::vector<std::int64_t> closings, openings;
};

Turns TurnsOf(const Shard& shard, const Clip& clip) {
  const Tensor actions = shard.actions.narrow(0, clip.first, clip.frames).to(at::kFloat).contiguous();
  const float* numbers = actions.data_ptr<float>();
  Turns turns;
  for (std::int64_t frame = 1; frame < clip.frames; ++frame) {
    for (const std::int64_t hand : {7, 15}) {
      const bool is_closed = nn::IsClosed(numbers[16 * frame + hand]),
                 was_closed = nn::IsClosed(numbers[16 * (frame - 1) + hand]);
      if (is_closed && !was_closed) turns.closings.push_back(frame);
      if (!is_closed && was_closed) turns.openings.push_back(frame);
    }
  }
  return turns;
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
    RefuseOption("windows", {"failure_weight", options.failure_weight}, "above 0");
  for (const Clip& clip : shards.clips()) {
    if (!options.successes_only || clip.outcome == 1) AddClip(shards, clip);
  }
  if (all_.any.empty())
    throw TensorError(std::string("no clip ") +
                      (shards.split() == Split::kHoldout ? "of the hold-out of " : "to learn from of ") + shards.FolderNames() + " has " +
                      std::to_string(options.chunk + 1) + " frames" +
                      (options.successes_only ? " and ended in success" : ""));
}

void WindowSampler::AddClip(const ShardSet& shards, const Clip& clip) {
  const Shard& shard = shards.shards()[clip.shard];
  const Turns turns = TurnsOf(shard, clip);
  const std::int64_t half = options_.chunk / 2;
  for (std::int64_t last = 0; last + options_.chunk < clip.frames; ++last) {
    const auto shows_what_comes_of = [&](std::int64_t frame) { return frame > last - half && frame <= last + half; };
    const auto add_to = [&](Pool& pool) {
      pool.any.push_back({&clip, last});
      if (last % options_.chunk == 0) pool.rollout.push_back({&clip, last});
    };
    add_to(all_);
    if (HasContact(shard, clip, last + 1, options_.chunk)) add_to(contact_);
    if (std::any_of(turns.closings.begin(), turns.closings.end(), shows_what_comes_of)) add_to(closing_);
    if (std::any_of(turns.openings.begin(), turns.openings.end(), shows_what_comes_of)) add_to(opening_);
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

const WindowSampler::Start& WindowSampler::PickStart(const std::vector<Start>& starts, Dice& dice) const {
  const double failed = std::min(1.0, options_.failure_weight), other = std::min(1.0, 1 / options_.failure_weight);
  constexpr int kMostDraws = 1000;  // all may be of the rarer kind
  for (int draw = 1;; ++draw) {
    const Start& start = starts[static_cast<std::size_t>(dice.Below(static_cast<std::int64_t>(starts.size())))];
    const double kept = start.clip->outcome == 0 ? failed : other;
    if (kept >= 1 || draw == kMostDraws || dice.Chance(kept)) return start;
  }
}

Window WindowSampler::Pick(Dice& dice) const {
  const bool rollout = dice.Chance(options_.rollout_share), contact = dice.Chance(options_.contact_share);
  const auto starts_of = [&](const Pool& pool) -> const std::vector<Start>& { return rollout ? pool.rollout : pool.any; };
  const std::vector<Start>* starts = &starts_of(all_);
  if (contact && !starts_of(contact_).empty()) starts = &starts_of(contact_);
  const auto is_drawn = [&](double share) { return share > 0 && dice.Chance(share); };
  if (is_drawn(options_.closing_share)) {
    if (!starts_of(closing_).empty()) starts = &starts_of(closing_);
  } else if (is_drawn(options_.opening_share)) {
    if (!starts_of(opening_).empty()) starts = &starts_of(opening_);
  }
  const Start& start = PickStart(*starts, dice);
  Window window{start.clip, {}, start.last, options_.chunk, 0};
  window.memory = rollout ? RolloutMemory(start.last, options_.memory) : RandomMemory(start.last, dice);
  const auto any = static_cast<std::size_t>(dice.Below(options_.memory));
  window.image = window.memory[options_.first_image ? 0 : any];
  return window;
}

std::vector<Window> WindowSampler::Spread(std::int64_t count) const {
  std::vector<Window> windows;
  const auto all = static_cast<std::int64_t>(all_.rollout.size());
  for (std::int64_t i = 0; i < std::min(count, all); ++i) {
    const Start& start = all_.rollout[static_cast<std::size_t>(i * all / std::min(count, all))];
    windows.push_back({start.clip, RolloutMemory(start.last, options_.memory), start.last, options_.chunk, 0});
    windows.back().image = windows.back().memory.front();
  }
  return windows;
}

}  // namespace evac::train
