#include "judges/rating_words.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace evac {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

const std::string kId(32, 'a');

nlohmann::json Body() {
  return {{"client_uuid", "0123456789abcdef"},
          {"presentation", kId},
          {"tab_epoch", 3},
          {"label", "success"},
          {"coverage", 0.95}};
}

TEST(RatingWords, AVerdictIsReadWithAllItSays) {
  nlohmann::json body = Body();
  body["stages"] = 5, body["flags"] = {"blur_hides", "wrong_object"}, body["note"] = "it fell\nthen \"rolled\" 😀",
  body["seeks"] = 4;
  body["played"] = {{0, 1.5}, {2, 3}}, body["confidence"] = 2, body["supersedes"] = 17, body["interrupted"] = true;
  const auto parsed = ParseVerdict(body.dump());
  ASSERT_TRUE(parsed.value) << parsed.problem;
  EXPECT_EQ(parsed.value->stages, 5);
  EXPECT_EQ(parsed.value->flags, "blur_hides wrong_object");
  EXPECT_EQ(parsed.value->note, "it fell\nthen \"rolled\" 😀");
  EXPECT_EQ(parsed.value->played, "[[0,1.5],[2,3]]");
  EXPECT_EQ(parsed.value->supersedes, 17);
  EXPECT_EQ(parsed.value->confidence, 2);
  EXPECT_EQ(parsed.value->seeks, 4);
  EXPECT_TRUE(parsed.value->interrupted);
}

TEST(RatingWords, WhatIsWrongIsNamed) {
  const auto problem = [](const char* name, nlohmann::json value) {
    nlohmann::json body = Body();
    body[name] = std::move(value);
    return ParseVerdict(body.dump()).problem;
  };
  EXPECT_THAT(problem("label", "yes"), HasSubstr("label: found 'yes', wanted success, failure, cannot_tell"));
  EXPECT_THAT(problem("label", "retracted"), HasSubstr("label"));
  EXPECT_THAT(problem("coverage", 1.5), HasSubstr("coverage: wanted 0 … 1"));
  EXPECT_THAT(problem("presentation", "../../etc/passwd"), HasSubstr("presentation"));
  EXPECT_THAT(problem("tab_epoch", -1), HasSubstr("tab_epoch"));
  EXPECT_THAT(problem("tab_epoch", 1e300), HasSubstr("tab_epoch"));
  EXPECT_THAT(problem("stages", 70000), HasSubstr("stages"));
  EXPECT_THAT(problem("flags", {"nonsense"}), HasSubstr("flags"));
  EXPECT_THAT(problem("note", std::string(3000, 'x')), HasSubstr("note: 3000 bytes"));
  EXPECT_THAT(problem("note", std::string("a\0b", 3)), HasSubstr("control"));
  EXPECT_THAT(problem("played", {{3, 1}}), HasSubstr("played"));
  EXPECT_THAT(problem("client_uuid", "short"), HasSubstr("client_uuid"));
  EXPECT_THAT(problem("client_uuid", "'; DROP TABLE verdicts; --"), HasSubstr("client_uuid"));
  EXPECT_THAT(ParseVerdict("{}").problem, HasSubstr("client_uuid: is missing"));
  EXPECT_THAT(ParseVerdict("[1]").problem, HasSubstr("no JSON object"));
  EXPECT_THAT(ParseVerdict(std::string(100'000, '[')).problem, HasSubstr("no JSON object"));
  EXPECT_THAT(problem("rt_ms", nullptr), IsEmpty()) << "null is as if it were not there";
}

TEST(RatingWords, ATabInANoteLosesNoVerdict) {
  nlohmann::json body = Body();
  body["note"] = "reach\tgood\r\n\tgrasp\tbad";
  const auto parsed = ParseVerdict(body.dump());
  ASSERT_TRUE(parsed.value) << parsed.problem;
  EXPECT_EQ(parsed.value->note, "reach\tgood\r\n\tgrasp\tbad") << "as it was typed";
  for (const char* control : {"\x01", "\x0b", "\x1b"}) {
    body["note"] = std::string("a") + control + "b";
    EXPECT_THAT(ParseVerdict(body.dump()).problem, HasSubstr("note: has control characters"));
  }
}

TEST(RatingWords, ATabThatStayedOpenForWeeksLosesNoVerdict) {
  constexpr double kDay_ms = 24 * 3600e3;
  nlohmann::json body = Body();
  body["shown_at_ms"] = 20 * kDay_ms, body["first_play_ms"] = 20 * kDay_ms + 500, body["decided_ms"] = 30 * kDay_ms;
  body["rt_ms"] = 10 * kDay_ms, body["visible_ms"] = 8 * kDay_ms, body["stalls_ms"] = 8 * kDay_ms;
  const auto parsed = ParseVerdict(body.dump());
  ASSERT_TRUE(parsed.value) << parsed.problem;
  EXPECT_EQ(parsed.value->decided_ms, 30 * kDay_ms) << "what it was, not what a limit makes of it";
  EXPECT_EQ(parsed.value->rt_ms, 10 * kDay_ms);
  EXPECT_EQ(parsed.value->visible_ms, 8 * kDay_ms);
  body["rt_ms"] = 1e300;
  EXPECT_THAT(ParseVerdict(body.dump()).problem, HasSubstr("rt_ms: wanted 0"));
}

TEST(RatingWords, ARangeOfAnotherKindIsNoneAndOneOutsideOfTheFileIsOne) {
  for (const char* one : {"bytes=0-", "bytes=5-9", "bytes=-4", "bytes=100-", "bytes=-0"})
    EXPECT_TRUE(IsOneRange(one)) << one;
  for (const char* other : {"", "items=0-", "bytes", "bytes=", "bytes=-", "bytes=5-4", "bytes=0-1,5-6", "bytes=1-2x"})
    EXPECT_FALSE(IsOneRange(other)) << other;
}

TEST(RatingWords, RangesStayInsideTheFile) {
  const auto range = [](const char* header) {
    const auto found = ParseRange(header, 100);
    return found ? std::pair<std::int64_t, std::int64_t>(found->first, found->count)
                 : std::pair<std::int64_t, std::int64_t>(-1, -1);
  };
  EXPECT_EQ(range("bytes=0-"), (std::pair<std::int64_t, std::int64_t>(0, 100)));
  EXPECT_EQ(range("bytes=10-19"), (std::pair<std::int64_t, std::int64_t>(10, 10)));
  EXPECT_EQ(range("bytes=-4"), (std::pair<std::int64_t, std::int64_t>(96, 4)));
  EXPECT_EQ(range("bytes=90-1000"), (std::pair<std::int64_t, std::int64_t>(90, 10)));
  EXPECT_EQ(range("bytes=-1000"), (std::pair<std::int64_t, std::int64_t>(0, 100)));
  for (const char* bad : {"", "bytes=", "bytes=-", "bytes=100-", "bytes=5-4", "bytes=0-1,5-6", "items=0-", "bytes=-0",
                          "bytes=1-2x", "bytes=99999999999999999999-", "bytes=--1", "bytes= 1-2"})
    EXPECT_EQ(range(bad).first, -1) << bad;
}

TEST(RatingWords, WhereAListBeginsIsAWholeNumberOrNothing) {
  EXPECT_EQ(ParseFrom(""), 0u);
  EXPECT_EQ(ParseFrom("from=0"), 0u);
  EXPECT_EQ(ParseFrom("from=200"), 200u);
  for (const char* wrong :
       {"from=", "from=-1", "from=1&from=2", "from=1.5", "from=99999999999999999999", "From=1", "x"})
    EXPECT_FALSE(ParseFrom(wrong)) << wrong;
}

TEST(RatingWords, ACookieIsFoundAmongOthers) {
  EXPECT_EQ(CookieOf("a=1; evac_rating=abc; b=2", "evac_rating"), "abc");
  EXPECT_EQ(CookieOf("xevac_rating=abc", "evac_rating"), "");
  EXPECT_EQ(CookieOf("evac_ratingx=abc; evac_rating=", "evac_rating"), "");
  EXPECT_EQ(CookieOf("", "evac_rating"), "");
}

}  // namespace
}  // namespace evac
