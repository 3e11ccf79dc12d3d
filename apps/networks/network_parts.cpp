#include "apps/network_parts.h"

#include "judges/classifier_judge.h"

namespace evac {

void NeedNetworks() {}  // here they are

std::unique_ptr<Judge> MakeClassifier(const std::filesystem::path& weights, const Store& store) {
  auto judge = std::make_unique<ClassifierJudge>(weights, store.folder());
  judge->CheckKnows(store.Tasks());
  return judge;
}

}  // namespace evac
