#include "worldmodel/nn/mean_weights.h"

#include <ATen/ops/equal.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/nn/support.h"
#include "tests/support/temp_folder.h"
#include "worldmodel/nn/weight_keys.h"

namespace evac::nn {
namespace {

namespace fs = std::filesystem;

class MeanOfWeights : public testing::Test {
 protected:
  fs::path Written(const std::string& name, std::uint64_t seed, const TensorMetadata& metadata) const {
    RandomWeights random(seed);
    SaveWeights(folder_ / name, random, config_, {.metadata = metadata});
    return folder_ / name;
  }

  const ModelConfig config_ = TinyConfig();
  const TempFolder temp_;
  const fs::path folder_ = temp_.path();
};

TEST_F(MeanOfWeights, IsOfEveryParameter) {
  const fs::path a = Written("a", 1, {}), b = Written("b", 2, {}), c = Written("c", 3, {});
  FileWeights first(a, config_), second(b, config_), third(c, config_);
  MeanWeights mean({a, b, c}, config_);
  int read = 0;
  for (const auto& [key, shape] : CheckpointKeys(config_)) {
    const Tensor found = mean.Take(key, shape), one = first.Take(key, shape);
    ASSERT_EQ(found.defined(), one.defined()) << key;
    if (!found.defined()) continue;
    ++read;
    EXPECT_LT(LargestDifference(found, (one + second.Take(key, shape) + third.Take(key, shape)) / 3), 1e-6) << key;
  }
  EXPECT_GT(read, 100);
}

TEST_F(MeanOfWeights, SaysWhatAllSayAndWhereEachCameFrom) {
  const fs::path a = Written("a", 1, {{"codec", "x"}, {"recipe", "r"}, {"seed", "1"}, {"holdout", ".07"}, {"other", "1"}}),
                 b = Written("b", 2, {{"codec", "x"}, {"recipe", "r"}, {"seed", "2"}, {"holdout", ".07"}, {"other", "2"}});
  const TensorMetadata expected = {{"codec", "x"}, {"recipe", "r"}, {"seed", "1 | 2"}};
  TensorMetadata found = MeanWeights({a, b}, config_).Metadata();
  found.erase("format");
  EXPECT_EQ(found, expected);
}

TEST_F(MeanOfWeights, OfDifferentCodecsIsRefused) {
  const fs::path a = Written("a", 1, {{"codec", "x"}}), b = Written("b", 2, {{"codec", "y"}}), c = Written("c", 3, {});
  EXPECT_THAT([&] { MeanWeights({a, b}, config_); }, testing::ThrowsMessage<TensorError>(testing::HasSubstr("different codecs")));
  EXPECT_THROW(MeanWeights({c, a}, config_), TensorError);
  EXPECT_THROW(MeanWeights({a}, config_), TensorError);
}

TEST_F(MeanOfWeights, IsForWhatThoseAreForThatSayIt) {
  const fs::path a = Written("a", 1, {{"period_s", "0.1"}}), b = Written("b", 2, {}),
                 c = Written("c", 3, {{"period_s", "0.2"}});
  EXPECT_EQ(MeanWeights({a, b}, config_).Metadata().at("period_s"), "0.1");
  EXPECT_EQ(MeanWeights({b, a}, config_).Metadata().at("period_s"), "0.1");
  EXPECT_THAT([&] { MeanWeights({a, b, c}, config_); },
              testing::ThrowsMessage<TensorError>(testing::AllOf(testing::HasSubstr("period_s is '0.1'"), testing::HasSubstr("'0.2'"))));
}

}  // namespace
}  // namespace evac::nn
