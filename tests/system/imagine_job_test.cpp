#include "apps/networks/imagine_job.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "apps/networks/imagine_start.h"
#include "core/error.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;

/// What copies or writes such a page calls itself at every bracket; the process crashed.
TEST(Sidecar, AMillionBracketsInsteadOfAnotherJobsNumberAreRefused) {
  const TempFolder folder;
  const std::string deep = std::string(1'000'000, '[') + std::string(1'000'000, ']');
  ImagineArguments arguments;
  arguments.out = folder.path();
  const auto taken = [&](const std::string& page) {
    WriteText(folder / kImagined, page);
    return Sidecar(arguments, ImagineStart(), {{"eta", 1.0}, {"seed", 9}});
  };
  EXPECT_THAT([&] { taken("{\"job\": {\"eta\": " + deep + ", \"seed\": 0}}"); },
              testing::ThrowsMessage<Error>(HasSubstr("eta is another; seed is 0 there, 9 here")));
  EXPECT_THAT([&] { taken("{\"job\": " + deep + "}"); },
              testing::ThrowsMessage<Error>(HasSubstr("says of no job of evac imagine")));
  EXPECT_NO_THROW(taken("{\"job\": {\"eta\": 1.0, \"seed\": 9}}"));
}

}  // namespace
}  // namespace evac
