#include "worldmodel/train/identity_text.h"

#include <gtest/gtest.h>

namespace evac::train {
namespace {

constexpr const char* kNumbers = "0x1.0624dd2f1a9fcp-9 0x1p-1 0x1.ccccccccccccdp-1 0x1.ff7ced916872bp-1 0x1p-27 "
                                 "0x1p-6 0x1p+0 0x1.ff7ced916872bp-1 0x0p+0 0x1p+2 ";
constexpr const char* kSettings = "seed 0 batch 4\nlearning_rate 0.002\nview_weights \nbf16 1\noptimiser adamw\n";

std::string Identity(const std::string& last, const std::string& settings = kSettings) {
  return kNumbers + settings + last;
}

/// The whole of both was printed, and the reader looked for it.
TEST(IdentityText, WhatDiffersIsSaidByTheNameThatTheUserHasForIt) {
  const std::string rest = " products bfloat16 workers 2 threads 4 page cc forecast dd init ee except a. except b.",
                    own = Identity("aa bb" + rest);
  EXPECT_EQ(WhatDiffers(own, own), "");
  EXPECT_EQ(WhatDiffers(own, Identity("ff bb" + rest)), "SHARDS, by recipe, is aa there, ff here");
  EXPECT_EQ(WhatDiffers(own, Identity("aa gg" + rest)), "the shards' codec, by SHA-256, is bb there, gg here");
  EXPECT_EQ(WhatDiffers(own, Identity("aa bb workers 2 threads 8 page hh forecast dd widened init ee except a.")),
            "--init-except is a. b. there, a. here; --init-widen is none there, given here; --products of "
            "`evac encode` is bfloat16 there, none here; --threads is 4 there, 8 here; the page of sizes, by hash, "
            "is cc there, hh here");
  EXPECT_EQ(WhatDiffers(Identity("aa workers 1"), Identity("aa workers 1 device cuda")),
            "--device is none there, cuda here");
}

TEST(IdentityText, OptionsAreSaidAsTheyAreTyped) {
  const std::string muon = "muon 0x1.e666666666666p-1 seed 7 batch 8\nlearning_rate 0.001\nview_weights 1,0.25\n"
                           "bf16 1\noptimiser muon\nmomentum 0.94999999999999996\nlate_start 0.5\n";
  EXPECT_EQ(WhatDiffers(Identity("aa"), Identity("aa", muon)),
            "batch is 4 there, 8 here; late_start is none there, 0.5 here; learning_rate is 0.002 there, 0.001 here; "
            "momentum is none there, 0.95 here; optimiser is adamw there, muon here; seed is 0 there, 7 here; "
            "view_weights is none there, 1,0.25 here");
}

}  // namespace
}  // namespace evac::train
