#include <fmt/format.h>

#include <algorithm>
#include <chrono>

#include "apps/factory.h"
#include "apps/networks/fidelity.h"
#include "core/file.h"

namespace evac {
namespace {

/// Why the first of them failed; empty: none did.
std::string FailureAmong(const std::vector<Advanced>& answers) {
  for (const Advanced& answer : answers) {
    if (const auto* failure = std::get_if<Failure>(&answer)) return failure->message;
  }
  return "";
}

void CountIn(const Episode& episode, PartEpisodes& counted) {
  ++counted.episodes;
  if (!IsFailure(episode.stop)) return;
  ++counted.failed;
  counted.last_failure = episode.key.Id() + ": " + episode.failure;
}

}  // namespace

Number SecondsPerChunk(World& world, std::span<const Replay> replays, int chunk) try {
  std::vector<ActionChunk> chunks;
  for (const Replay& replay : replays) chunks.push_back({{replay.actions.begin(), replay.actions.begin() + chunk}, false, 0});
  std::vector<SceneChunk> batch;
  for (std::size_t i = 0; i < chunks.size(); ++i) {
    batch.push_back({static_cast<SceneId>(i), &chunks[i]});
    world.Reset(batch[i].scene, *replays[i].task, replays[i].initial, 0);
  }
  std::string failure = FailureAmong(world.Advance(batch));  // pages are touched, kernels compiled
  const auto begin = std::chrono::steady_clock::now();
  const std::vector<Advanced> answers = world.Advance(batch);
  const std::chrono::duration<double> spent = std::chrono::steady_clock::now() - begin;
  if (failure.empty()) failure = FailureAmong(answers);
  if (!failure.empty()) return Undefined{"the world model failed: " + failure};
  return spent.count() / static_cast<double>(batch.size());
} catch (const Error& error) {
  return Undefined{fmt::format("the world model failed: {}", error.what())};
}

Number SecondsPerChunk(const SuiteWorld& model, const Suite& suite, const Store& scenes, std::vector<Replay> replays,
                       int chunk) {
  std::erase_if(replays, [&](const Replay& replay) { return replay.actions.size() < static_cast<std::size_t>(chunk); });
  replays.resize(std::min<std::size_t>(replays.size(), static_cast<std::size_t>(suite.lanes)));
  if (replays.empty()) return Undefined{"no replay is a chunk long"};
  SuiteWorld uncached = model;
  uncached.evac->cache_folder.reset();
  const std::unique_ptr<World> world = MakeWorld(uncached, suite, &scenes);
  return SecondsPerChunk(*world, replays, chunk);
}

PartEpisodes EpisodesOf(const std::string& part, const Store& store) {
  PartEpisodes counted{.part = part};
  for (const Episode& episode : store.Episodes()) CountIn(episode, counted);
  return counted;
}

PartEpisodes EpisodesOf(const std::string& part, const Store& store, const std::vector<Replay>& replays) {
  std::set<PairKey> pairs;
  for (const Replay& replay : replays) pairs.insert(replay.pair);
  PartEpisodes counted{.part = part};
  for (const Episode& episode : store.Episodes()) {
    if (pairs.contains(episode.key.pair)) CountIn(episode, counted);
  }
  return counted;
}

void FinishFidelity(const std::filesystem::path& out, FidelityInput input) {
  const Fidelity fidelity = FidelityOf(std::move(input));
  WriteFileAtomically(out / "episodes.csv", FidelityCsv(fidelity.input.rows));
  WriteFileAtomically(out / "fidelity.json", FidelityJson(fidelity));
  WriteFileAtomically(out / "index.html", FidelityPage(fidelity));
  fmt::print("{}\n{}\n", FidelityText(fidelity), (out / "index.html").string());
}

}  // namespace evac
