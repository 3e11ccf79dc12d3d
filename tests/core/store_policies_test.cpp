#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/error.h"
#include "core/store.h"
#include "tests/core/store_samples.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

/// A policy that was refused and then mended could not run in that folder any more.
TEST(StoredPolicies, OneWithoutEpisodesMaySayNowWhatItDidNot) {
  const TempFolder folder;
  Store store = Store::InMemory(folder / "m", samples::SomeRun());
  samples::Declare(store);
  const std::size_t count = store.Policies().size();
  store.AddPolicyAsItIsNow({"visual_pick", "good", "{}"});
  EXPECT_EQ(store.Policies().size(), count);
  store.Add(samples::SomeEpisode(store, samples::Key(1, "real")));
  EXPECT_THAT([&] { store.AddPolicyAsItIsNow({"visual_pick", "good", R"({"arms": 2})"}); },
              ThrowsMessage<Error>(HasSubstr("visual_pick@good")));
  store.AddPolicyAsItIsNow({"visual_pick", "good", "{}"});
  EXPECT_EQ(store.Policies().size(), count);
}

}  // namespace
}  // namespace evac
