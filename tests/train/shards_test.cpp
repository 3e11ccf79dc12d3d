#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "tests/support/temp_folder.h"
#include "tests/train/synthetic_shards.h"

namespace evac::train {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

using Change = std::function<void(const std::string& name, Tensor& tensor)>;

/// A training shard of two views that was changed so is refused by its name with these words; as it was, it is not.
void ExpectRefused(const Change& change, const TensorMetadata& metadata, const std::string& words) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {.views = 2});
  const auto open = [&] { ShardSet(folder.path(), Split::kTrain); };
  EXPECT_NO_THROW(open()) << words;
  ChangeSyntheticShard(folder.path(), change, metadata);
  EXPECT_THAT(open, ThrowsMessage<TensorError>(AllOf(HasSubstr("shard_00000.safetensors"), HasSubstr(words))));
}

Change Of(const std::string& wanted, const std::function<void(Tensor& tensor)>& change) {
  return [=](const std::string& name, Tensor& tensor) {
    if (name == wanted) change(tensor);
  };
}

const Change kNothing = [](const std::string&, Tensor&) {};

TEST(ShardSet, NumbersThatAreNoneAreRefusedByFileTensorAndRow) {
  for (const std::string tensor : {"actions", "deltas", "c2w", "k"}) {
    for (const auto& [number, word] : {std::pair(std::nan(""), "nan"), std::pair(-HUGE_VAL, "-inf")})
      ExpectRefused(Of(tensor, [&, value = number](Tensor& t) { t[7].view(-1)[3] = value; }), {},
                    "row 7 of " + tensor + " holds " + word + ", wanted finite numbers");
  }
}

TEST(ShardSet, ASplitThatIsNotThereIsSaidWithTheOptionThatMakesIt) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {});
  ChangeSyntheticShard(folder.path(), kNothing, {{"split", "holdout"}});
  EXPECT_NO_THROW(ShardSet(folder.path(), Split::kHoldout));
  EXPECT_THAT([&] { ShardSet(folder.path(), Split::kTrain); },
              ThrowsMessage<TensorError>(HasSubstr("has no shard with split train (evac pack --holdout)")));
}

TEST(EachOnce, KeepsTheFirstOfFoldersThatAreTheSame) {
  const TempFolder folder;
  const std::filesystem::path a = folder / "a", b = folder / "b", link = folder / "link", none = folder / "none";
  for (const std::filesystem::path& made : {a, b}) std::filesystem::create_directories(made);
  std::filesystem::create_directory_symlink(a, link);
  EXPECT_EQ(EachOnce({b, a, b / "", link, b, none, none}), (ShardFolders{b, a, none}));
  EXPECT_EQ(EachOnce({a, b}), (ShardFolders{a, b}));
}

TEST(ShardSet, WhereTheObjectIsMayBeUnknown) {
  const TempFolder folder;
  WriteSyntheticShards(folder.path(), {.knows_object = false});
  EXPECT_NO_THROW(ShardSet(folder.path(), Split::kTrain));
}

TEST(ShardSet, AShardOfNoClipsIsRefused) {
  for (const std::int64_t numbers : {0, 1})
    ExpectRefused(Of("clip_start", [&](Tensor& t) { t = t.narrow(0, 0, numbers); }), {},
                  "clip_start has " + std::to_string(numbers) + " numbers, wanted at least 2");
}

TEST(ShardSet, ClipsThatLeaveRowsOutAreRefused) {
  ExpectRefused(Of("clip_start", [](Tensor& t) { t[0] = 1; }), {}, "clip_start goes from 1 to ");
  ExpectRefused(Of("clip_start", [](Tensor& t) { t[-1] -= 1; }), {}, ", all rows of its frames");
  ExpectRefused(Of("clip_start", [](Tensor& t) { t[-1] += 1; }), {}, ", all rows of its frames");
}

TEST(ShardSet, PicturesOfAnotherSizeThanItsCardSaysAreRefused) {
  ExpectRefused(kNothing, {{"height_px", "7"}}, "height_px is '");
  ExpectRefused(kNothing, {{"width_px", "7"}}, "width_px is '");
}

TEST(ShardSet, PicturesOfNoViewsOrPixelsAreRefused) {
  for (const std::int64_t side : {1, 2, 3})
    ExpectRefused(Of("frames", [&](Tensor& t) { t = t.narrow(side, 0, 0); }), {},
                  "wanted at least one view of at least one pixel");
}

TEST(ShardSet, CamerasThatAreNotOnePerViewAreRefused) {
  for (const char* cameras : {"", "head", "head,hand_right,hand_left"})
    ExpectRefused(kNothing, {{"cameras", cameras}},
                  std::string("cameras is '") + cameras + "', wanted 2 names, one per view");
}

TEST(ShardSet, ArmsThatNoRobotHasAreRefused) {
  for (const char* arms : {"", "left", "left,right,third"})
    ExpectRefused(kNothing, {{"arms", arms}}, std::string("arms is '") + arms + "', wanted 'right' or 'left,right'");
}

TEST(ShardSet, AnOutcomeThatIsNoneIsRefused) {
  for (const int outcome : {2, -2})
    ExpectRefused(Of("outcome", [&](Tensor& t) { t[4] = outcome; }), {},
                  "clip 4 has outcome " + std::to_string(outcome) + ", wanted 1 for success");
}

}  // namespace
}  // namespace evac::train
