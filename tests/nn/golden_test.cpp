#include <fmt/format.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "core/tensor_file.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

struct Answer {
  std::string output;
  int exit_code = -1;
};

Answer RunCheck(const fs::path& folder) {
  const std::string command = fmt::format("'{}/evac_golden_check' '{}' 2>&1", EVAC_BIN_DIR, folder.string());
  Answer answer;
  FILE* pipe = ::popen(command.c_str(), "r");
  std::array<char, 4096> buffer{};
  while (std::size_t count = std::fread(buffer.data(), 1, buffer.size(), pipe))
    answer.output.append(buffer.data(), count);
  answer.exit_code = WEXITSTATUS(::pclose(pipe));
  return answer;
}

const fs::path kGolden = fs::path(EVAC_SHARED_DIR) / "data/evac_golden";

TEST(GoldenCheck, EveryFileOfTheReferenceAgrees) {
#ifdef __SANITIZE_THREAD__
  GTEST_SKIP() << "more than a quarter of an hour of one thread alone, in which ThreadSanitizer can find nothing";
#endif
  if (!fs::exists(kGolden)) GTEST_SKIP() << kGolden << " is not there";
  const Answer answer = RunCheck(kGolden);
  EXPECT_EQ(answer.exit_code, 0) << answer.output;
  EXPECT_NE(answer.output.find("19 passed, 0 failed, 0 skipped\n"), std::string::npos) << answer.output;
}

class OddFolder : public testing::Test {
 protected:
  const TempFolder temp_;
  const fs::path folder_ = temp_.path();
};

TEST_F(OddFolder, AFileOfAnUnknownKindIsSkippedAndThatIsNoSuccess) {
  const float number = 1;
  const TensorView tensor{{"something", TensorType::kF32, {1}}, std::as_bytes(std::span(&number, 1))};
  WriteTensorFile(folder_ / "odd.safetensors", std::span(&tensor, 1), {});
  const Answer answer = RunCheck(folder_);
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_NE(answer.output.find("0 passed, 0 failed, 1 skipped\n"), std::string::npos) << answer.output;
}

TEST_F(OddFolder, AChangedNumberFails) {
  if (!fs::exists(kGolden)) GTEST_SKIP() << kGolden << " is not there";
  const TensorFile file = TensorFile::Open(kGolden / "raymaps.safetensors");
  std::vector<TensorView> tensors = file.tensors();
  std::vector<std::byte> changed(tensors.back().bytes.begin(), tensors.back().bytes.end());
  changed[changed.size() - 2] ^= std::byte{0x40};
  tensors.back().bytes = changed;
  WriteTensorFile(folder_ / "raymaps.safetensors", tensors, file.metadata());
  const Answer answer = RunCheck(folder_);
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_NE(answer.output.find("0 passed, 1 failed, 0 skipped\n"), std::string::npos) << answer.output;
}

TEST_F(OddFolder, ATruncatedFileFailsByName) {
  std::ofstream(folder_ / "cut.safetensors") << "short";
  const Answer answer = RunCheck(folder_);
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_NE(answer.output.find("cut.safetensors: cut off"), std::string::npos) << answer.output;
}

}  // namespace
}  // namespace evac
