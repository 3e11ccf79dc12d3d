#include "apps/network_parts.h"

#include <mutex>

#include "judges/classifier_judge.h"
#include "policies/learned_policy.h"
#include "worldmodel/nn/threads.h"

namespace evac {

void NeedNetworks() {}  // here they are

std::unique_ptr<Judge> MakeClassifier(const std::filesystem::path& weights, const Store& store) {
  auto judge = std::make_unique<ClassifierJudge>(weights, store.folder());
  judge->CheckKnows(store.Tasks());
  return judge;
}

std::unique_ptr<Policy> MakeLearnedPolicy(const std::filesystem::path& weights, int chunk_size) {
  static std::once_flag first;
  std::call_once(first, [] { nn::UseLibraryThreadsForGood(1); });  // the rest of this process records
  nn::UseLibraryThreadsHere(1);
  return std::make_unique<LearnedPolicy>(weights, chunk_size);
}

}  // namespace evac
