#include "apps/network_parts.h"

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
  static const nn::LibraryThreads one_each(1);  // for as long as the process records
  nn::UseLibraryThreadsHere(1);
  return std::make_unique<LearnedPolicy>(weights, chunk_size);
}

}  // namespace evac
