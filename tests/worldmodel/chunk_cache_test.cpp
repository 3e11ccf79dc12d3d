#include "worldmodel/chunk_cache.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <fstream>

#include "core/hash.h"
#include "core/tensor_file.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

std::string KeyOf(int number) { return std::string(62, 'a') + std::to_string(number); }

CachedChunk SmallChunk() {
  return {{std::vector<float>(1000, 1.0F)}, {{cv::Mat(10, 10, CV_8UC3, cv::Scalar(1, 2, 3))}}};
}

void MakeOld(const fs::path& file, int hours) {
  fs::last_write_time(file, fs::file_time_type::clock::now() - std::chrono::hours(hours));
}

fs::path Written(const fs::path& file, int hours) {
  fs::create_directories(file.parent_path());
  std::ofstream(file) << std::string(20000, 'x');
  MakeOld(file, hours);
  return file;
}

/// Names that are not quite those of an entry, or of one that is being written.
std::vector<fs::path> FilesOfSomebody(const fs::path& folder) {
  const std::string key = KeyOf(10), entry = key + ".safetensors", capitals = std::string(62, 'A') + "10";
  std::vector<fs::path> files;
  for (const std::string& name :
       {std::string("suite.yaml"), std::string("weights.safetensors"), entry, std::string("aa/clip.mp4"),
        std::string("aa/weights.safetensors"), "aa/" + key + ".txt", "aa/" + entry + ".bak", "ab/" + entry,
        "aa/" + entry + ".partial-", "aa/" + entry + ".partial-12.mp4", "aa/" + capitals + ".safetensors",
        "aa/deep/" + entry, "aaa/" + entry, "runs/aa/" + entry, std::string("shards/shard_00000.safetensors")})
    files.push_back(Written(folder / name, 100));
  return files;
}

TEST(ChunkCache, FilesThatAreNotItsOwnAreNeverRemoved) {
  const TempFolder folder;
  const std::vector<fs::path> others = FilesOfSomebody(folder.path());
  ChunkCache cache({.folder = folder.path(), .limit_gb = 20e-6});
  for (int i = 10; i < 30; ++i) {
    cache.Keep(KeyOf(i), SmallChunk());
    MakeOld(folder / "aa" / (KeyOf(i) + ".safetensors"), 40 - i);
  }
  for (const fs::path& file : others) EXPECT_TRUE(fs::exists(file)) << file;
  EXPECT_FALSE(cache.Find(KeyOf(10))) << "its own are still evicted";
  for (const int i : {28, 29}) EXPECT_TRUE(cache.Find(KeyOf(i))) << "and others' do not count";
}

TEST(ChunkCache, WhatNobodyHasFinishedForADayIsRemovedAndWhatIsBeingWrittenIsNot) {
  const TempFolder folder;
  const fs::path old_entry = folder / "aa" / (KeyOf(10) + ".safetensors");
  fs::create_directories(old_entry.parent_path());
  const TensorDeclaration tensor{"latents", TensorType::kF32, {1}};
  const TensorFileWriter abandoned(old_entry, {&tensor, 1}, {});
  const fs::path partial = fs::directory_iterator(old_entry.parent_path())->path();
  Written(old_entry, 100);
  const ChunkCache while_it_is_written({.folder = folder.path()});
  EXPECT_TRUE(fs::exists(partial));
  MakeOld(partial, 25);
  const ChunkCache a_day_later({.folder = folder.path()});
  EXPECT_FALSE(fs::exists(partial));
  EXPECT_TRUE(fs::exists(old_entry)) << "whole, and below the limit";
}

/// Each process counted its own alone: two of them kept twice the limit.
TEST(ChunkCache, TheLimitIsTheFoldersHoweverManyWriteThere) {
  const TempFolder folder;
  const ChunkCacheOptions options{.folder = folder.path(), .limit_gb = 20e-6};
  ChunkCache one(options), another(options);
  const auto bytes = [&] {
    std::uintmax_t sum = 0;
    for (const auto& entry : fs::directory_iterator(folder / "aa")) sum += entry.file_size();
    return sum;
  };
  std::uintmax_t most = 0;
  for (int i = 10; i < 13; ++i) {
    one.Keep(KeyOf(i), SmallChunk());
    another.Keep(KeyOf(i + 10), SmallChunk());
    most = std::max(most, bytes());
  }
  EXPECT_LE(most, 22'000U) << "a tenth of the limit more, at most";
  EXPECT_GE(most, 10'000U) << "or nothing is tested";
  EXPECT_TRUE(another.Find(KeyOf(22)));
}

/// 2^40 frames of no numbers have no bytes, and were made one by one.
TEST(ChunkCache, AnEntryOfManyFramesWithoutNumbersIsAMiss) {
  const TempFolder folder;
  ChunkCache cache({.folder = folder.path()});
  fs::create_directories(folder / "aa");
  for (const std::vector<std::int64_t>& views : {std::vector<std::int64_t>{0, 10, 10}, {1, 0, 10}, {1, 10, 0}}) {
    const TensorView tensors[] = {
        {{"latents", TensorType::kF32, {1000, 0}}, {}},
        {{"pictures", TensorType::kU8, {1000, views[0], views[1], views[2], 3}}, {}}};
    const std::string nothing = Sha256Hex(""), hash = Sha256Hex(nothing + nothing);
    WriteTensorFile(folder / "aa" / (KeyOf(10) + ".safetensors"), tensors,
                    {{"format", "evac chunk 1"}, {"sha256", hash}});
    EXPECT_FALSE(cache.Find(KeyOf(10)));
  }
  cache.Keep(KeyOf(11), SmallChunk());
  EXPECT_TRUE(cache.Find(KeyOf(11)));
}

}  // namespace
}  // namespace evac
