#include "apps/progress_display.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

namespace evac {
namespace {

TEST(CountDisplay, InALogEverySayIsALineOfItsOwnAndTheyAreFew) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> log(std::tmpfile(), std::fclose);
  CountDisplay display("clips", log.get());
  const auto start = CountDisplay::Clock::now();
  for (int done = 1; done <= 40; ++done) display.Show(done, 40, start + std::chrono::seconds(done));
  std::rewind(log.get());
  std::string text(4096, '\0');
  text.resize(std::fread(text.data(), 1, text.size(), log.get()));
  EXPECT_THAT(text, testing::StartsWith("10 of 40 clips, 30 s left\n20 of 40 clips, 20 s left\n"));
  EXPECT_THAT(text, testing::EndsWith("\n40 of 40 clips\n"));
  EXPECT_THAT(text, testing::Not(testing::HasSubstr("\r")));
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 4);
}

}  // namespace
}  // namespace evac
