#include "worldmodel/train/csv_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <iterator>

#include "core/tensor_file.h"
#include "tests/support/temp_folder.h"

namespace evac::train {
namespace {

std::string Text(const std::filesystem::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(CsvLog, ATableIsReplacedAtOnceAndOnlyWhereRowsAreDropped) {
  const TempFolder folder;
  const std::filesystem::path table = folder / "metrics.csv", before = folder / "before.csv";
  CsvLog::Trim(table, "step,loss", 0);
  for (const char* row : {"0,3", "1,2", "2,1"}) CsvLog::Add(table, row);
  std::filesystem::create_hard_link(table, before);  // the same file under another name

  CsvLog::Trim(table, "step,loss", 3);
  EXPECT_EQ(std::filesystem::hard_link_count(table), 2U) << "nothing was dropped: it is the same file still";
  CsvLog::Trim(table, "step,loss", 2);
  EXPECT_EQ(Text(table), "step,loss\n0,3\n1,2\n");
  EXPECT_EQ(Text(before), "step,loss\n0,3\n1,2\n2,1\n") << "the old table stayed whole until the new one was";
}

TEST(CsvLog, ARowThatWasCutOffGoes) {
  const TempFolder folder;
  const std::filesystem::path table = folder / "metrics.csv";
  std::ofstream(table) << "step,loss\n0,3\n1";
  CsvLog::Trim(table, "step,loss", 2);
  CsvLog::Add(table, "1,2");
  EXPECT_EQ(Text(table), "step,loss\n0,3\n1,2\n");
}

/// It was somebody's wrong input, without the reason.
TEST(CsvLog, ADiskThatTakesNoMoreIsTheMachines) {
  EXPECT_THAT([] { CsvLog::Add("/dev/full", "0,3"); },
              testing::ThrowsMessage<TensorWriteError>(
                  testing::AllOf(testing::HasSubstr("/dev/full: cannot be written: "), testing::HasSubstr("No space left"))));
}

}  // namespace
}  // namespace evac::train
