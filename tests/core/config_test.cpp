#include "core/config.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <set>

#include "core/file.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr const char* kPage = R"(# a comment
name: demo
lanes: 4
big: 18446744073709551615
friction: 0.75
light: yes
empty:
worlds:
  - {name: real, images: [1.5, 2]}
  - {name: sim}
nested:
  deep: {deeper: 1}
)";

Config Page() { return Config::FromText(kPage, "suites/page.yaml"); }

template <typename Call>
std::string MessageOf(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
    return error.what();
  }
  return "no error";
}

TEST(Config, FieldsComeBackAsTheTypeAskedFor) {
  const Config page = Page();
  EXPECT_EQ(page.Get<std::string>("name"), "demo");
  EXPECT_EQ(page.Get<int>("lanes"), 4);
  EXPECT_EQ(page.Get<double>("lanes"), 4.0);
  EXPECT_EQ(page.Get<std::uint64_t>("big"), ~std::uint64_t{0});
  EXPECT_EQ(page.Get<double>("friction"), 0.75);
  EXPECT_TRUE(page.Get<bool>("light"));
  EXPECT_EQ(page.Get<int>("absent", 7), 7);
  EXPECT_EQ(page.Get<int>("empty", 7), 7);
  EXPECT_EQ(page.Section("nested").Section("deep").Get<int>("deeper"), 1);
  EXPECT_THAT(page.List("worlds").at(0).Get<std::vector<double>>("images"), ElementsAre(1.5, 2));
  EXPECT_THAT(page.List("absent"), IsEmpty());
  EXPECT_THAT(page.Section("nested").Keys(), ElementsAre("deep"));
}

TEST(Config, AWrongFieldIsNamedWithFileLineFoundAndWanted) {
  const Config page = Page();
  EXPECT_THAT(MessageOf([&] { page.Get<int>("name"); }), AllOf(HasSubstr("suites/page.yaml:2: field name"),
                                                               HasSubstr("found 'demo'"), HasSubstr("a whole number")));
  EXPECT_THAT(MessageOf([&] { page.Get<int>("friction"); }), HasSubstr("found '0.75'"));
  EXPECT_THAT(MessageOf([&] { page.Get<int>("big"); }), HasSubstr("found '18446744073709551615'"));
  EXPECT_THAT(MessageOf([&] { page.Get<bool>("lanes"); }), HasSubstr("true or false"));
  EXPECT_THAT(MessageOf([&] { page.Get<std::string>("worlds"); }), HasSubstr("found a list"));
  EXPECT_THAT(MessageOf([&] { page.Get<std::string>("absent"); }),
              AllOf(HasSubstr("field absent"), HasSubstr("found nothing")));
  EXPECT_THAT(MessageOf([&] { page.List("worlds").at(1).Get<int>("name"); }),
              HasSubstr("suites/page.yaml:10: field worlds.1.name"));
  EXPECT_THAT(MessageOf([&] { page.Section("lanes"); }), HasSubstr("a mapping"));
  EXPECT_THAT(MessageOf([&] { page.List("lanes"); }), HasSubstr("a list"));
  EXPECT_THAT(MessageOf([&] { page.Require(false, "lanes", "fewer than 3"); }),
              HasSubstr("page.yaml:3: field lanes: found '4', wanted fewer than 3"));
}

TEST(Config, NumbersAreFiniteAndSeedsAreNotNegative) {
  const Config page = Config::FromText("a: .inf\nb: .nan\nc: [1, .inf]\nd: -1\ne: 1.5\n", "p");
  EXPECT_THAT(MessageOf([&] { page.Get<double>("a"); }), HasSubstr("found '.inf', wanted a number"));
  EXPECT_THAT(MessageOf([&] { page.Get<double>("b"); }), HasSubstr("found '.nan'"));
  EXPECT_THAT(MessageOf([&] { page.Get<std::vector<double>>("c"); }), HasSubstr("a list of numbers"));
  EXPECT_THAT(MessageOf([&] { page.Get<std::uint64_t>("d"); }), HasSubstr("0 or more"));
  EXPECT_THAT(MessageOf([&] { page.Get<std::uint64_t>("e"); }), HasSubstr("0 or more"));
}

TEST(Config, AnUnknownFieldIsNamedWithTheNearestKnownOne) {
  EXPECT_THAT(MessageOf([&] {
                Page().AllowOnly({"name", "lanse", "big", "friction", "light", "empty", "worlds", "nested"});
              }),
              AllOf(HasSubstr("page.yaml:3: field lanes"), HasSubstr("the nearest is 'lanse'")));
  EXPECT_THAT(MessageOf([&] { Page().AllowOnly({}); }), HasSubstr("field name"));
  EXPECT_NO_THROW(Page().Section("nested").AllowOnly({"deep", "more"}));
}

TEST(Config, WhatIsNoMappingIsRefusedWithItsLine) {
  EXPECT_THAT(MessageOf([] { Config::FromText("a: 1\nb: [1\n", "p.yaml"); }),
              AllOf(HasSubstr("p.yaml:"), HasSubstr("not YAML")));
  EXPECT_THAT(MessageOf([] { Config::FromText("- a\n- b\n", "p.yaml"); }), HasSubstr("found a list"));
  EXPECT_THAT(MessageOf([] { Config::FromText("", "p.yaml"); }), HasSubstr("found nothing"));
  EXPECT_THAT(MessageOf([] { Config::FromText("just words", "p.yaml"); }), HasSubstr("found 'just words'"));
  EXPECT_THAT(MessageOf([] { Config::FromText("a: {b: 1,\n  c: 2,\n  b: 3}\n", "p.yaml"); }),
              HasSubstr("p.yaml:3: field b is given twice"));
  EXPECT_THAT(MessageOf([] { Config::FromText("x:\n- {[1, 2]: 3}\n", "p.yaml"); }),
              HasSubstr("p.yaml:2: found a list as a key"));
  EXPECT_THAT(MessageOf([] { Config::FromFile("no/such/page.yaml"); }), HasSubstr("no/such/page.yaml"));
}

TEST(Config, ASecondDocumentIsRefusedAndNotForgotten) {
  for (const char* text : {"a: 1\n---\nb: 2\n", "# c\n---\na: 1\n--- # next\nb: 2\n", "a: 1\n...\nb: 2\n"})
    EXPECT_THAT(MessageOf([&] { Config::FromText(text, "p.yaml"); }), HasSubstr("found a second document")) << text;
  for (const char* text : {"---\na: 1\n", "%YAML 1.2\n# c\n--- \na: 1\n...\n# end\n", "a: |\n  ---\n  x\nb: ---x\n"})
    EXPECT_TRUE(Config::FromText(text, "p.yaml").Has("a")) << text;
}

TEST(Config, AliasesWithoutEndAreRefused) {
  for (const char* text : {"b: 1\na: &x [*x]\n", "b: 1\na: &x {c: [1, *x]}\n"})
    EXPECT_THAT(MessageOf([&] { Config::FromText(text, "p.yaml"); }), AllOf(HasSubstr("p.yaml:2"), HasSubstr("alias")));
  std::string laughs = "a0: &a0 [x, x, x, x, x, x, x, x, x, x]\n";  // ten to the power of nine
  for (int i = 1; i < 9; ++i) {
    laughs += fmt::format("a{0}: &a{0} [", i);
    for (int times = 0; times < 10; ++times) laughs += fmt::format("*a{}, ", i - 1);
    laughs += "]\n";
  }
  EXPECT_THAT(MessageOf([&] { Config::FromText(laughs, "p.yaml"); }), HasSubstr("more than 250000 values"));
  const Config page = Config::FromText("a: &x [1, 2]\nb: *x\n", "p.yaml");
  EXPECT_THAT(page.Get<std::vector<double>>("b"), ElementsAre(1, 2));
}

/// A page of a megabyte stood for 220 gigabytes, and every reader walked through them.
TEST(Config, ALongTextThatManyAliasesNameIsRefused) {
  const std::string text(1 << 20, 'x');
  std::string names;
  for (int times = 0; times < 100; ++times) names += "*t, ";
  EXPECT_THAT(MessageOf([&] { Config::FromText("t: &t " + text + "\nb: [" + names + "]\n", "p.yaml"); }),
              AllOf(HasSubstr("p.yaml:1"), HasSubstr("more than 64 MB")));
  EXPECT_THAT(MessageOf([&] { Config::FromText("t: &t {? '" + text + "' : 1}\nb: [" + names + "]\n", "p.yaml"); }),
              HasSubstr("more than 64 MB"))
      << "a key is written for every value below it";
  EXPECT_TRUE(Config::FromText("t: &t " + text + "\nb: [*t, *t]\n", "p.yaml").Has("b"));
}

TEST(Config, BytesThatAreNoUtf8AreRefusedWithTheirLine) {
  EXPECT_THAT(MessageOf([] { Config::FromText("a: 1\nc\xEF mmand: 2\n", "p.yaml"); }),
              AllOf(HasSubstr("p.yaml:2"), HasSubstr("0xef"), HasSubstr("UTF-8")));
  EXPECT_THAT(MessageOf([] { Config::FromText("a: 1\nb: [\"\\_\"]\n", "p.yaml"); }), HasSubstr("p.yaml:2: an escape"));
  EXPECT_EQ(Config::FromText("a: \xC3\xA9\n", "p.yaml").Get<std::string>("a"), "\xC3\xA9");
}

/// The library writes "1\r" as it is and reads "1\r\n" as "1": a stored page would mean something else. Found by
/// fuzzing.
TEST(Config, ACarriageReturnInAValueIsRefusedAndOneThatEndsALineIsNot) {
  for (const char* text :
       {"a: 1\nb: con-a}\r", "a: 1\nb: \"x\\r\"\n", "a: 1\nb: [x, \"\\r\"]\n", "a: 1\n\"b\\r\": 1\n"})
    EXPECT_THAT(MessageOf([&] { Config::FromText(text, "p.yaml"); }),
                AllOf(HasSubstr("p.yaml:2"), HasSubstr("carriage return")))
        << text;
  Config page = Config::FromText("a: one\r\nb: |\r\n  two\r\n  lines\r\nc: \"folded\r\n  text\"\r\n", "p.yaml");
  EXPECT_EQ(page.Get<std::string>("a"), "one");
  EXPECT_EQ(page.Get<std::string>("b"), "two\nlines\n");
  EXPECT_EQ(page.Get<std::string>("c"), "folded text");
  EXPECT_THAT(MessageOf([&] { page.Set("a=\"x\\r\""); }), AllOf(HasSubstr("--set"), HasSubstr("carriage return")));
  EXPECT_THAT(MessageOf([&] { page.Set("a={x: 1, x: 2}"); }), AllOf(HasSubstr("--set"), HasSubstr("given twice")));
}

TEST(Config, AnAssignmentReplacesAFieldAnItemOrAddsAField) {
  Config page = Page();
  page.Set("lanes=9");
  page.Set("worlds.1.name=dream");
  page.Set("worlds.0.images.1=3.5");
  page.Set("nested.deep.new={x: [1, 2]}");
  page.Set("text=a=b");
  EXPECT_EQ(page.Get<int>("lanes"), 9);
  EXPECT_EQ(page.List("worlds").at(1).Get<std::string>("name"), "dream");
  EXPECT_EQ(page.List("worlds").at(0).Get<std::string>("name"), "real");
  EXPECT_THAT(page.List("worlds").at(0).Get<std::vector<double>>("images"), ElementsAre(1.5, 3.5));
  EXPECT_THAT(page.Section("nested").Section("deep").Section("new").Get<std::vector<std::uint64_t>>("x"),
              ElementsAre(1, 2));
  EXPECT_EQ(page.Get<std::string>("text"), "a=b");
  EXPECT_EQ(page.Get<std::string>("name"), "demo");
}

TEST(Config, AnAssignmentWithoutAPlaceOrAValueIsRefused) {
  for (const char* assignment :
       {"lanes", "=4", "worlds.2.name=a", "worlds.9=a", "worlds.x=a", "worlds.x.y.z=a", "lanes.x=1", "lanes.x.y=1",
        "lanes.=1", "nested..x=1", ".x=1", "a=[1"}) {
    Config page = Page();
    const std::string before = page.Canonical();
    EXPECT_THAT(MessageOf([&] { page.Set(assignment); }), HasSubstr(assignment));
    EXPECT_EQ(page.Canonical(), before);
  }
}

/// `--set transport.start_s=30`, which a message advises, was refused where the page had no such section.
TEST(Config, SectionsOnTheWayOfAnAssignmentAreMade) {
  Config page = Page();
  for (const char* assignment : {"absent.x=1", "absent.y={z: 2}", "nested.other.new=3", "empty.x=4", "worlds.1.a.b=5"})
    page.Set(assignment);
  EXPECT_EQ(page.Section("absent").Get<int>("x"), 1);
  EXPECT_EQ(page.Section("absent").Section("y").Get<int>("z"), 2);
  EXPECT_EQ(page.Section("nested").Section("other").Get<int>("new"), 3);
  EXPECT_EQ(page.Section("nested").Section("deep").Get<int>("deeper"), 1) << "what was there stays";
  EXPECT_EQ(page.Section("empty").Get<int>("x"), 4);
  EXPECT_EQ(page.List("worlds").at(1).Section("a").Get<int>("b"), 5);
  EXPECT_EQ(Config::FromText(page.Text(), "again").Canonical(), page.Canonical());
  EXPECT_THAT(MessageOf([&] { page.Section("absent").AllowOnly({"why"}); }),
              HasSubstr("suites/page.yaml (--set): field absent.x: there is no such field"));
  EXPECT_THAT(MessageOf([&] { page.AllowOnly({"name", "lanes", "big", "friction", "light", "empty", "worlds", "nested"}); }),
              HasSubstr("suites/page.yaml (--set): field absent: there is no such field"));
}

/// It was set for all that the alias names: a run compared a policy with itself.
TEST(Config, AnAssignmentToAFieldThatAnAliasSharesIsRefused) {
  const char* text = R"(policies:
  - &p {name: a, command: &c [x, good]}
  - {name: b, command: *c}
  - *p
)";
  for (const auto& [assignment, fields] :
       {std::pair("policies.0.command=[x, y]", "fields policies.0.command and policies.1.command are one"),
        std::pair("policies.1.command=[x, y]", "fields policies.0.command and policies.1.command are one"),
        std::pair("policies.1.command.1=y", "fields policies.0.command.1 and policies.1.command.1 are one"),
        std::pair("policies.2.name=c", "fields policies.0.name and policies.2.name are one"),
        std::pair("policies.2.new=c", "fields policies.0 and policies.2 are one")}) {
    Config page = Config::FromText(text, "p.yaml");
    const std::string before = page.Canonical();
    EXPECT_THAT(MessageOf([&] { page.Set(assignment); }),
                AllOf(HasSubstr(assignment), HasSubstr("p.yaml"), HasSubstr(fields)));
    EXPECT_EQ(page.Canonical(), before) << assignment;
  }
  Config page = Config::FromText(text, "p.yaml");
  page.Set("policies.1.name=c");
  EXPECT_EQ(page.List("policies").at(1).Get<std::string>("name"), "c");
  EXPECT_EQ(page.List("policies").at(2).Get<std::string>("name"), "a");
}

TEST(Config, AFieldFromTheCommandLineIsNotBlamedOnALineOfTheFile) {
  Config page = Page();
  page.Set("lanes=many");
  EXPECT_THAT(MessageOf([&] { page.Get<int>("lanes"); }),
              HasSubstr("suites/page.yaml (--set): field lanes: found 'many'"));
}

TEST(Config, AMissingFieldIsMissedInTheFile) {
  const Config page = Config::FromText("a: 1\n", "p.yaml");
  EXPECT_THAT(MessageOf([&] { page.Get<int>("b"); }), HasSubstr("p.yaml:1: field b: found nothing"));
}

TEST(Config, TheCanonicalTextIsAboutContentAlone) {
  const auto canonical = [](const std::string& text) { return Config::FromText(text, "p").Canonical(); };
  EXPECT_EQ(canonical("a: 1\nb: {c: x, d: [1, 2]}\n"),
            canonical("# layout\nb:\n  d:\n  - 1\n  - 2\n  c: 'x'\na:   1\n"));
  const char* const different[] = {
      "a: 1",  "a: 2",  "b: 1", "a: [1]",          "a: {b: 1}",         "a: [1, 2]",  "a: [2, 1]",
      "a: {}", "a: []", "a:",   "a: \"1\\n.b=1\"", "a: \"1\\\\n.b=1\"", "a: 1\nb: 1", "c: {}\na: 1"};
  std::set<std::string> seen;
  for (const char* text : different) EXPECT_TRUE(seen.insert(canonical(text)).second) << text;
}

TEST(Config, ItsTextMeansTheSameAgain) {
  Config page = Page();
  page.Set("worlds.1.name=\"7\"");
  EXPECT_EQ(Config::FromText(page.Text(), "again").Canonical(), page.Canonical());
}

TEST(Config, PathsAreRelativeToTheFile) {
  const TempFolder folder;
  WriteFileAtomically(folder / "p.yaml", "a: data/x\nb: /data/x\n");
  const Config page = Config::FromFile(folder / "p.yaml");
  EXPECT_EQ(page.Path("a"), folder / "data/x");
  EXPECT_EQ(page.Path("b"), "/data/x");
}

}  // namespace
}  // namespace evac
