#include "core/tensor_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstring>
#include <filesystem>
#include <fstream>

#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

std::string FileOf(const std::string& header, std::size_t data_bytes) {
  std::string bytes(8, '\0');
  const std::uint64_t length = header.size();
  std::memcpy(bytes.data(), &length, 8);
  return bytes + header + std::string(data_bytes, 'x');
}

TensorFile Parsed(const std::string& bytes) { return TensorFile::Parse(bytes, "a.safetensors"); }

std::string ReadAll(const std::filesystem::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class TensorFileOnDisk : public testing::Test {
 protected:
  const TempFolder temp_;
  const std::filesystem::path folder_ = temp_.path();
};

TEST_F(TensorFileOnDisk, SavedLoadedAndSavedAgainIsTheSameFile) {
  const float numbers[3] = {1, 2.5F, -3};
  const std::int64_t count = 7;
  const TensorView tensors[] = {{{"z.weight", TensorType::kF32, {3, 1}}, std::as_bytes(std::span(numbers))},
                                {{"a \"quoted\" \\ name\n", TensorType::kI64, {}}, std::as_bytes(std::span(&count, 1))},
                                {{"nothing", TensorType::kBF16, {0, 4}}, {}}};
  WriteTensorFile(folder_ / "a", tensors, {{"model", "{\"width\": 32}"}, {"é", "ü"}});
  const TensorFile file = TensorFile::Open(folder_ / "a");
  EXPECT_EQ(file.metadata().at("é"), "ü");
  EXPECT_EQ(file.Get("z.weight").shape, (std::vector<std::int64_t>{3, 1}));
  EXPECT_EQ(std::memcmp(file.Get("z.weight").bytes.data(), numbers, sizeof numbers), 0);
  WriteTensorFile(folder_ / "b", file.tensors(), file.metadata());
  EXPECT_EQ(ReadAll(folder_ / "a"), ReadAll(folder_ / "b"));
}

TEST_F(TensorFileOnDisk, PagesThatWereLetGoAreReadAgain) {
  const std::vector<float> numbers(100'000, 0.25F);
  const TensorView tensor{{"x", TensorType::kF32, {100'000}}, std::as_bytes(std::span(numbers))};
  WriteTensorFile(folder_ / "a", std::span(&tensor, 1), {});
  const TensorFile file = TensorFile::Open(folder_ / "a");
  file.LetGo(file.Get("x"));
  EXPECT_EQ(std::memcmp(file.Get("x").bytes.data(), numbers.data(), numbers.size() * sizeof(float)), 0);
}

TEST_F(TensorFileOnDisk, AFileThatWasNotFinishedIsNotThere) {
  {
    const TensorDeclaration tensor{"x", TensorType::kF32, {2}};
    TensorFileWriter writer(folder_ / "a", std::span(&tensor, 1), {});
    const float one = 1;
    writer.Append(std::as_bytes(std::span(&one, 1)));
    EXPECT_THAT([&] { writer.Finish(); }, ThrowsMessage<TensorError>(HasSubstr("4 declared bytes are missing")));
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

TEST_F(TensorFileOnDisk, WhatAKilledWriterLeftGoesWithTheNextWriterOfTheSamePath) {
  const pid_t writer = StartCommand({"/bin/sleep", "600"}, folder_ / "log");
  const std::string left = "a.partial-" + std::to_string(writer);
  const std::vector<std::string> others = {"a", "b." + left, "a.partial-", "a.partial-1x", "a.partial--1", "log"};
  for (const std::string& name : others) std::ofstream(folder_ / name) << "x";
  std::ofstream(folder_ / left) << "half";
  WriteTensorFile(folder_ / "a", {}, {});
  EXPECT_TRUE(std::filesystem::exists(folder_ / left)) << "its process lives";
  ::kill(writer, SIGKILL);
  ::waitpid(writer, nullptr, 0);
  WriteTensorFile(folder_ / "a", {}, {});
  EXPECT_FALSE(std::filesystem::exists(folder_ / left));
  for (const std::string& name : others) EXPECT_TRUE(std::filesystem::exists(folder_ / name)) << name;
}

TEST_F(TensorFileOnDisk, AFileWhoseHeaderDoesNotFitOnTheDiskLeavesNothing) {
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &limit), 0);
  const rlimit little{4, limit.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &little), 0);
  std::string message = "no error";
  try {
    TensorFileWriter(folder_ / "a", std::vector<TensorDeclaration>{{"x", TensorType::kU8, {1}}}, {});
  } catch (const TensorError& error) {
    message = error.what();
  }
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
  std::signal(SIGXFSZ, handler);
  EXPECT_THAT(message, HasSubstr("cannot write"));
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
}

/// All that writes weights, latents or trainings ended with 2 (invalid input) on a full disk.
TEST_F(TensorFileOnDisk, AFullDiskIsAnotherErrorThanAFolderThatIsNotThere) {
  const std::vector<float> numbers(1000, 0.25F);
  const TensorView tensor{{"x", TensorType::kF32, {1000}}, std::as_bytes(std::span(numbers))};
  const auto write = [&](const std::filesystem::path& path) { WriteTensorFile(path, std::span(&tensor, 1), {}); };
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &limit), 0);
  for (const rlim_t bytes : {4, 2000}) {  // within the header, within the numbers
    const rlimit little{bytes, limit.rlim_max};
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &little), 0);
    std::string message = "no error";
    try {
      write(folder_ / "a");
    } catch (const TensorWriteError& error) {
      message = error.what();
    } catch (const TensorError&) {
      message = "blamed on the tensors";
    }
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
    EXPECT_THAT(message, HasSubstr("cannot write")) << bytes;
  }
  std::signal(SIGXFSZ, handler);
  EXPECT_TRUE(std::filesystem::is_empty(folder_));
  std::filesystem::create_directory(folder_ / "folder");
  for (const char* place : {"none/a", "folder"}) {
    try {
      write(folder_ / place);
      ADD_FAILURE() << place << " was written";
    } catch (const TensorWriteError&) {
      ADD_FAILURE() << place << ": the machine is blamed";
    } catch (const TensorError& error) {
      EXPECT_THAT(error.what(), HasSubstr(place));
    }
  }
  std::filesystem::remove(folder_ / "folder");
  EXPECT_TRUE(std::filesystem::is_empty(folder_)) << "parts are left";
}

/// Weights took the place of the link, or of the device, that they were written to.
TEST_F(TensorFileOnDisk, ALinkStaysOneAndWhatIsNoRegularFileIsRefused) {
  namespace fs = std::filesystem;
  fs::create_directory(folder_ / "below");
  fs::create_symlink("../a", folder_ / "below/link");
  for (int twice = 0; twice < 2; ++twice) {
    WriteTensorFile(folder_ / "below/link", {}, {{"time", std::to_string(twice)}});
    EXPECT_EQ(TensorFile::Open(folder_ / "a").metadata().at("time"), std::to_string(twice));
    EXPECT_TRUE(fs::is_symlink(folder_ / "below/link"));
  }
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_THAT([&] { WriteTensorFile(folder_ / "pipe", {}, {}); },
              ThrowsMessage<TensorError>(HasSubstr((folder_ / "pipe").string() + ": is no regular file")));
  EXPECT_TRUE(fs::is_fifo(folder_ / "pipe"));
}

TEST_F(TensorFileOnDisk, AMissingFileIsNamed) {
  EXPECT_THAT([&] { TensorFile::Open(folder_ / "none"); }, ThrowsMessage<TensorError>(HasSubstr("none: cannot open")));
}

TEST(TensorFile, AMovedFileKeepsItsBytes) {
  TensorFile file = Parsed(FileOf(R"({"x":{"dtype":"U8","shape":[2],"data_offsets":[0,2]}})", 2));
  const TensorFile moved = std::move(file);
  EXPECT_EQ(static_cast<char>(moved.Get("x").bytes[1]), 'x');
}

struct Broken {
  const char* name;
  std::string bytes;
  const char* message;
};
std::string OneTensor(const std::string& fields, std::size_t data_bytes) {
  return FileOf("{\"x\":{" + fields + "}}", data_bytes);
}

class BrokenTensorFile : public testing::TestWithParam<Broken> {};

TEST_P(BrokenTensorFile, IsRefusedByName) {
  EXPECT_THAT([&] { Parsed(GetParam().bytes); }, ThrowsMessage<TensorError>(HasSubstr("a.safetensors")));
  EXPECT_THAT([&] { Parsed(GetParam().bytes); }, ThrowsMessage<TensorError>(HasSubstr(GetParam().message)));
}

INSTANTIATE_TEST_SUITE_P(
    TensorFile, BrokenTensorFile,
    testing::Values(
        Broken{"Empty", "", "cut off"}, Broken{"HugeHeader", std::string(7, '\xff') + '\x7f', "claims"},
        Broken{"HeaderPastTheEnd", FileOf("{}", 0).substr(0, 9), "claims 2 bytes"},
        Broken{"NoJson", FileOf("hello", 0), "wanted '{'"}, Broken{"TextAfter", FileOf("{}{}", 0), "follows"},
        Broken{"UnknownType", OneTensor(R"("dtype":"F31","shape":[],"data_offsets":[0,4])", 4), "dtype 'F31'"},
        Broken{"NegativeSide", OneTensor(R"("dtype":"F32","shape":[-1],"data_offsets":[0,4])", 4), "whole number"},
        Broken{"TooManySides",
               OneTensor(R"("dtype":"U8","shape":[1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1,1],"data_offsets":[0,1])", 1),
               "more than 16"},
        Broken{"LyingShape", OneTensor(R"("dtype":"F32","shape":[3],"data_offsets":[0,8])", 8), "wanted 12 bytes"},
        Broken{"OverflowingShape",
               OneTensor(R"("dtype":"F32","shape":[4294967296,4294967296,2],"data_offsets":[0,8])", 8), "beyond"},
        Broken{"Gap", OneTensor(R"("dtype":"F32","shape":[1],"data_offsets":[4,8])", 8), "from byte 0"},
        Broken{"PastTheEnd", OneTensor(R"("dtype":"F32","shape":[2],"data_offsets":[0,8])", 4), "of 4"},
        Broken{"Leftover", OneTensor(R"("dtype":"F32","shape":[1],"data_offsets":[0,4])", 5), "belong to none"},
        Broken{"NoShape", OneTensor(R"("dtype":"F32","data_offsets":[0,4])", 4), "wanted dtype, shape"},
        Broken{
            "Twice",
            FileOf(
                R"({"x":{"dtype":"U8","shape":[],"data_offsets":[0,1]},"x":{"dtype":"U8","shape":[],"data_offsets":[1,2]}})",
                2),
            "twice"},
        Broken{"ControlCharacter", FileOf("{\"a\nb\":1}", 0), "control character"},
        Broken{"HalfASurrogate", FileOf(R"({"\ud800":1})", 0), "surrogate"},
        Broken{"NumberBeyond64Bits",
               OneTensor(R"("dtype":"U8","shape":[99999999999999999999],"data_offsets":[0,1])", 1), "whole number"}),
    [](const auto& info) { return info.param.name; });

TEST(TensorFile, OverlappingTensorsAreRefused) {
  const std::string header =
      R"({"x":{"dtype":"U8","shape":[2],"data_offsets":[0,2]},"y":{"dtype":"U8","shape":[2],"data_offsets":[1,3]}})";
  EXPECT_THAT([&] { Parsed(FileOf(header, 3)); }, ThrowsMessage<TensorError>(HasSubstr("'y' claims bytes 1 to 3")));
}

}  // namespace
}  // namespace evac
