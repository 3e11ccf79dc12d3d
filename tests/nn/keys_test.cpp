#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <sstream>

#include "worldmodel/evac_config.h"
#include "worldmodel/nn/evac_model.h"

namespace evac::nn {
namespace {

const std::filesystem::path kPage = std::filesystem::path(EVAC_SOURCE_DIR) / "apps/configs/evac_published.yaml";
const std::filesystem::path kKeys = std::filesystem::path(EVAC_SHARED_DIR) / "data/evac_state_dict_keys.tsv";

/// "(1280, 320)" as Python prints it; "(1000,)" for one side.
std::string PythonShape(const std::vector<std::int64_t>& shape) {
  std::string text = "(";
  for (std::size_t i = 0; i < shape.size(); ++i) text += (i ? ", " : "") + std::to_string(shape[i]);
  return text + (shape.size() == 1 ? ",)" : ")");
}

TEST(CheckpointKeys, ArePreciselyThoseOfThePublishedModelInItsOrder) {
  std::ifstream lines(kKeys);
  if (!lines) GTEST_SKIP() << kKeys << " is not there";
  const std::vector<ParameterShape> ours = CheckpointKeys(ReadEvacConfig(kPage));
  std::size_t count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    std::istringstream columns(line);
    std::string key, shape, type;
    std::getline(columns, key, '\t');
    std::getline(columns, shape, '\t');
    ASSERT_LT(count, ours.size()) << key;
    EXPECT_EQ(ours[count].key, key) << "line " << count + 1;
    EXPECT_EQ(PythonShape(ours[count].shape), shape) << key;
  }
  EXPECT_EQ(count, 2310u);
  EXPECT_EQ(ours.size(), count);
}

TEST(CheckpointKeys, OfTheDefaultSizesAreThoseOfThePublishedPage) {
  const std::vector<ParameterShape> page = CheckpointKeys(ReadEvacConfig(kPage)),
                                    defaults = CheckpointKeys(ModelConfig{});
  ASSERT_EQ(page.size(), defaults.size());
  for (std::size_t i = 0; i < page.size(); ++i) {
    EXPECT_EQ(page[i].key, defaults[i].key);
    EXPECT_EQ(page[i].shape, defaults[i].shape) << page[i].key;
  }
}

}  // namespace
}  // namespace evac::nn
