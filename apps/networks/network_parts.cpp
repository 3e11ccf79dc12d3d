#include "apps/network_parts.h"

#include <ATen/Parallel.h>

#include "judges/classifier_judge.h"
#include "policies/learned_policy.h"

namespace evac {

void NeedNetworks() {}  // here they are

std::unique_ptr<Judge> MakeClassifier(const std::filesystem::path& weights, const Store& store) {
  auto judge = std::make_unique<ClassifierJudge>(weights, store.folder());
  judge->CheckKnows(store.Tasks());
  return judge;
}

std::unique_ptr<Policy> MakeLearnedPolicy(const std::filesystem::path& weights, int chunk_size) {
  at::set_num_threads(1);  // of this thread, which is one of many that record
  return std::make_unique<LearnedPolicy>(weights, chunk_size);
}

}  // namespace evac
