#pragma once

#include <filesystem>
#include <string>
#include <utility>

#include "core/error.h"
#include "tests/core/store_samples.h"

/// What a process does to a store that is killed, or runs out of room, while it does so.
namespace evac::samples {

/// What a run does from its start: opens, tidies up, and adds what is not there yet.
inline void AddMissing(const std::filesystem::path& run, int count) {
  Store store = Store::CreateOrContinue(run, SomeRun());
  store.RemoveOrphans();
  Declare(store);
  for (int i = 0; i < count; ++i) {
    if (store.Has(Key(i))) continue;
    store.AddInitialScene(Key(i).pair, {{Image(i)}, {}, {}});
    store.Add(SomeEpisode(store, Key(i)));
    store.AddVerdict({.episode_id = Key(i).Id(),
                      .judge = "oracle",
                      .label = Label::kSuccess,
                      .probability = {},
                      .stages = {},
                      .reason = "",
                      .rubric_version = ""});
  }
}

/// Adds until it is told that there is no room. @returns how many episodes were added, and the error.
inline std::pair<int, std::string> AddUntilFull(const std::filesystem::path& run, int most) {
  int added = 0;
  try {
    Store store = Store::CreateOrContinue(run, SomeRun());
    Declare(store);
    for (; added < most; ++added) store.Add(SomeEpisode(store, Key(added)));
  } catch (const Error& error) {
    if (error.exit_code() != ExitCode::kInternal) throw;
    return {added, error.what()};
  }
  return {added, ""};
}

}  // namespace evac::samples
