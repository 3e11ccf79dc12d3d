#include <cstdint>
#include <cstdlib>

#include "core/error.h"
#include "core/store.h"
#include "core/store_codec.h"
#include "tests/fuzz/scratch.h"

namespace {

/// Everything a reader of a run asks for.
void ReadAll(const evac::Store& store) {
  store.run();
  store.Tasks();
  store.Worlds();
  store.Policies();
  store.PageHashes();
  store.Plan();
  store.Verdicts();
  store.CurrentVerdicts();
  store.CountersByPolicy();
  store.RealTrials();
  store.Looks();
  store.GateRecords();
  for (const std::string& judge : store.Judges()) store.ForEachEnded(judge, [](const evac::EndedEpisode&) {});
  for (evac::Episode episode : store.Episodes()) {
    store.LoadSteps(episode);
    store.LoadPrivileged(episode.key.Id());
  }
  for (const evac::PairKey& pair : store.InitialScenes()) store.LoadInitialScene(pair.task, pair.initial_state);
}

}  // namespace

/// Any bytes are a run's database, or an Error; so are any bytes in its blobs. The first byte says which of them these
/// are.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const std::string bytes(reinterpret_cast<const char*>(data) + 1, size - 1);
  try {
    switch (data[0] % 5) {
      case 0:
        evac::codec::DecodeArms(bytes);
        break;
      case 1:
        evac::codec::DecodePrivileged(bytes);
        break;
      case 2:
        evac::codec::DecodeCameras(bytes);
        break;
      case 3:
        evac::codec::DecodeTask(bytes);
        break;
      default: {
        const Scratch scratch;
        scratch.Write("evac.sqlite", data + 1, size - 1);
        ReadAll(evac::Store::Open(scratch.folder(), evac::Store::Mode::kReadOnly));
      }
    }
  } catch (const evac::Error&) {
  }
  return 0;
}
