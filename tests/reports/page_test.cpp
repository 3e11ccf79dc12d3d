#include "reports/page.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>

#include "reports/charts.h"
#include "reports/html.h"
#include "tests/reports/sample_run.h"
#include "tests/reports/stored_run.h"

namespace evac {
namespace {

using testing::HasSubstr;
using testing::Not;

const PageOptions kBeside{"", "evac test"};

std::vector<std::string> Matches(const std::string& text, const std::string& pattern) {
  const std::regex regex(pattern);
  std::vector<std::string> found;
  for (auto it = std::sregex_iterator(text.begin(), text.end(), regex); it != std::sregex_iterator(); ++it)
    found.push_back((*it)[1]);
  return found;
}

/// The page without its <name>…</name> sections: what is in them is no HTML.
std::string Without(std::string page, const std::string& name) {
  const std::string open = "<" + name, close = "</" + name + ">";
  for (std::size_t begin = page.find(open); begin != std::string::npos; begin = page.find(open))
    page.erase(begin, page.find(close, begin) + close.size() - begin);
  return page;
}

/// "div" or "/div" of each tag, in order. No regular expression: std::regex needs stack for every letter it passes.
std::vector<std::string> TagNames(const std::string& page) {
  std::vector<std::string> names;
  for (std::size_t at = page.find('<'); at != std::string::npos; at = page.find('<', at)) {
    const std::size_t end_of_name = page.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789/", ++at);
    if (end_of_name == at) continue;  // <!doctype …
    names.push_back(page.substr(at, end_of_name - at));
    bool is_quoted = false;
    for (at = end_of_name; at < page.size() && (is_quoted || page[at] != '>'); ++at) is_quoted ^= page[at] == '"';
  }
  return names;
}

/// The tags left open, or closed without having been opened.
std::vector<std::string> UnbalancedTags(const std::string& page) {
  static const std::set<std::string> kVoid = {"meta", "wbr",  "img",  "link",   "br", "input",
                                              "path", "line", "rect", "circle", "use"};
  std::vector<std::string> open;
  for (std::string name : TagNames(Without(Without(page, "style"), "script"))) {
    const bool is_end = name.front() == '/';
    while (!is_end && name.back() == '/') name.pop_back();  // <br/>
    if (kVoid.count(is_end ? name.substr(1) : name) > 0) continue;
    if (!is_end) {
      open.push_back(name);
    } else if (!open.empty() && open.back() == name.substr(1)) {
      open.pop_back();
    } else {
      open.push_back(name);
      return open;
    }
  }
  return open;
}

std::string PathOf(std::string link) {
  const std::regex escape("%([0-9A-F]{2})");
  std::string path;
  for (std::smatch match; std::regex_search(link, match, escape); link = match.suffix()) {
    path += match.prefix().str() + static_cast<char>(std::stoi(match[1], nullptr, 16));
  }
  return path + link;
}

TEST(Page, TheSameRunGivesTheSameBytes) {
  const SampleRun& run = LargeRun();
  EXPECT_EQ(ReportPage(run.Summary(), kBeside), ReportPage(run.Summary(), kBeside));
}

TEST(Page, EveryTagIsClosed) {
  EXPECT_THAT(UnbalancedTags("<p><b>x</p>"), Not(testing::IsEmpty())) << "the check can fail";
  EXPECT_THAT(UnbalancedTags(ReportPage(LargeRun().Summary(), kBeside)), testing::IsEmpty());
  EXPECT_THAT(UnbalancedTags(ReportPage(SampleRun({{"a", "pick", "1", "sue?if", "f-"}}).Summary(), kBeside)),
              testing::IsEmpty());
}

/// What the page's script reads.
nlohmann::json DataOf(const std::string& page) {
  const std::string open = "<script type=\"application/json\" id=\"run-data\">";
  const std::size_t begin = page.find(open) + open.size();
  return nlohmann::json::parse(page.substr(begin, page.find("</script>", begin) - begin));
}

/// The value of one row of a column, as page/data.js decodes it.
std::string ValueOf(const nlohmann::json& column, std::size_t row) {
  static const std::string kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";
  const auto width = column.at("w").get<std::size_t>();
  std::size_t value = 0;
  for (std::size_t place = 0; place < width; ++place)
    value = value * 64 + kDigits.find(column.at("s").get<std::string>().at(row * width + place));
  return column.at("v").at(value);
}

TEST(Page, EveryVideoItNamesIsThere) {
  SampleRun run({{"take bottle", "pick#1", "50%", "sf?", "fse"}});
  const std::string page = ReportPage(run.Summary(), kBeside);
  const std::vector<std::string> links = Matches(page, "class=\"play\" href=\"([^\"]+)\"");
  ASSERT_EQ(links.size(), 4u) << "two flips of two videos, for those who read without script";
  for (const std::string& link : links) EXPECT_TRUE(std::filesystem::exists(run.folder() / PathOf(link))) << link;
}

TEST(Page, ItsDataTellEveryEpisodeAndWhereItsFilesLie) {
  SampleRun run({{"take bottle", "pick#1", "50%", "sf?", "fse"}});
  const RunSummary summary = run.Summary();
  const nlohmann::json data = DataOf(ReportPage(summary, kBeside)), columns = data.at("episodes");
  ASSERT_EQ(data.at("n"), summary.episodes.size());
  for (std::size_t i = 0; i < summary.episodes.size(); ++i) {
    const auto& [pair, world] = summary.episodes[i].episode.key;
    EXPECT_EQ(ValueOf(columns.at("task"), i), pair.task);
    EXPECT_EQ(ValueOf(columns.at("outcome"), i), Name(summary.episodes[i].outcome));
    const std::string video = fmt::format("videos/{}/{}/{}/{}-s{}.mp4", ValueOf(columns.at("world"), i), pair.task,
                                          ValueOf(columns.at("file"), i), pair.initial_state, pair.seed);
    EXPECT_TRUE(std::filesystem::exists(run.folder() / video)) << video;
  }
  EXPECT_EQ(columns.at("video"), (nlohmann::json{{"v", {"="}}, {"w", 0}, {"s", ""}})) << "all lie where their ids say";
}

TEST(Page, LinksFollowWhereThePageStands) {
  const std::string page =
      ReportPage(SampleRun({{"a", "pick", "1", "s", "f"}}).Summary(), {"../runs/one two", "evac test"});
  const std::vector<std::string> links = Matches(page, "class=\"play\" href=\"([^\"]+)\"");
  EXPECT_EQ(links.size(), 2u);
  for (const std::string& link : links) EXPECT_THAT(link, testing::StartsWith("../runs/one%20two/"));
  EXPECT_EQ(DataOf(page).at("run"), "../runs/one%20two/");
}

TEST(Page, EveryInnerLinkHasItsTarget) {
  const std::string page = ReportPage(SampleRun({{"take bottle", "pick", "1", "sf?e", "fss-"}}).Summary(), kBeside);
  const std::vector<std::string> ids = Matches(page, " id=\"([^\"]+)\"");
  const std::set<std::string> targets(ids.begin(), ids.end());
  EXPECT_EQ(ids.size(), targets.size()) << "an id is given twice";
  const std::vector<std::string> links = Matches(page, "href=\"#([^\"]+)\"");
  EXPECT_GT(links.size(), 6u);
  for (const std::string& link : links) {
    if (link.starts_with("clip-")) continue;  // opened by script
    EXPECT_TRUE(targets.count(link) == 1) << link;
  }
}

TEST(Page, NeedsNoNetworkAndLoadsNoVideoByItself) {
  const std::string page = ReportPage(LargeRun().Summary(), kBeside);
  for (const char* remote : {"http:", "https:", "src=\"//", "@import", "url(", "<video", "<img", "<link", "<iframe"})
    EXPECT_THAT(page, Not(HasSubstr(remote)));
  EXPECT_THAT(page, HasSubstr("default-src 'none'")) << "and it may not connect";
}

TEST(Page, TextFromOutsideIsNeverMarkup) {
  const std::string bad = "<script>alert('x')</script>\"&";
  RunData data = ReadRun(SampleRun({{"t", "pick", "1", "sfe", "fss"}}).store());
  data.run = {bad, bad, bad, bad};
  data.tasks[0].instruction = data.tasks[0].rubric.success = data.tasks[0].rubric.version = bad;
  data.tasks[0].rubric.stages[0].name = bad;
  data.policies[0].declaration = bad;
  data.counters[bad][bad] = 1;
  for (WorldInfo& world : data.worlds) world.type = world.profile_hash = bad;
  for (Episode& episode : data.episodes)
    episode.stop_reason = episode.failure = episode.video = episode.thumbnail = bad;
  for (auto& [episode, verdicts] : data.verdicts) {
    for (auto& [judge, verdict] : verdicts)
      verdict.reason = verdict.rubric_version = bad, verdict.stages = {{bad, true}};
  }
  const std::string page = ReportPage(Summarise(data, {}), {"", bad});
  EXPECT_THAT(page, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;alert"));
  EXPECT_EQ(Matches(page, "(<script)").size(), 2u) << "the data and our own";
  EXPECT_NO_THROW(DataOf(page));
}

TEST(Page, NamesFromOutsideAreNeverMarkup) {
  const std::string bad = "<img src=x onerror=\"alert(1)\">";
  RunData data = ReadRun(SampleRun({{"t", "pick", "1", "sf", "fs"}}).store());
  data.tasks[0].id = data.policies[0].name = bad;
  data.worlds[1].name = bad;
  std::map<std::string, std::map<std::string, Verdict>> verdicts;
  for (Episode& episode : data.episodes) {
    const std::string id = episode.key.Id();
    episode.key.pair.task = episode.key.pair.policy = episode.key.pair.initial_state = bad;
    if (episode.key.world != "real") episode.key.world = bad;
    verdicts[episode.key.Id()] = data.verdicts[id];
  }
  data.verdicts = verdicts;
  const std::string page = ReportPage(Summarise(data, {}), kBeside);
  EXPECT_THAT(page, Not(HasSubstr("<img src=x")));
  EXPECT_THAT(UnbalancedTags(page), testing::IsEmpty());
}

TEST(Page, MissingVerdictsAreSaidWithTheCommandThatGivesThem) {
  const std::string page = ReportPage(SampleRun({{"a", "pick", "1", "uu", "uu"}}).Summary(), kBeside);
  EXPECT_THAT(page, HasSubstr("4 episodes have no verdict by oracle."));
  EXPECT_THAT(page, HasSubstr("evac judge RUN --judge oracle"));
  EXPECT_THAT(page, HasSubstr("undefined: no verdict"));
  EXPECT_THAT(ReportPage(SampleRun({{"a", "pick", "1", "s", "s"}}).Summary(), kBeside),
              Not(HasSubstr("evac judge RUN")));
}

TEST(Page, MissingVerdictsOfAJudgeAreSaidWithACommandThatTheProgramTakes) {
  const SampleRun run({{"a", "pick", "1", "uu", "uu"}});
  const auto page = [&run](const std::string& judge) { return ReportPage(run.Summary({.judge = judge}), kBeside); };
  EXPECT_THAT(page("oracle,classifier:1a2b"),
              HasSubstr("<code>evac judge RUN --judge classifier --weights FILE</code>, then <code>evac report RUN</code>, "
                        "adds them."));
  EXPECT_THAT(page("vlm:qwen-1a2b3c4d"), HasSubstr("<code>evac judge RUN --judge vlm --config PAGE</code>"));
  EXPECT_THAT(page("human"),
              HasSubstr("<code>evac rate new STUDY --run RUN</code>, then <code>evac rate serve STUDY</code>, then "
                        "<code>evac rate resolve STUDY</code>, then <code>evac report RUN</code>, adds them."));
  EXPECT_THAT(page("<crowd>"), HasSubstr("evac rate resolve STUDY --as &lt;crowd&gt;"));
  EXPECT_THAT(page("human"), Not(HasSubstr("--judge human")));
}

/// Its examples and practice clips were "not judged yet" for ever, with commands that add nothing.
TEST(Page, WhatAStudyGivesNoLabelOfIsSaidBesideTheCommandsThatGiveThem) {
  const SampleRun run({{"a", "pick", "1", "uu", "uu"}});
  const auto page = [&run](const std::string& judge) { return ReportPage(run.Summary({.judge = judge}), kBeside); };
  EXPECT_THAT(page("human"), HasSubstr("adds them. But a study's examples and practice clips get no label."));
  EXPECT_THAT(page("human"), testing::ContainsRegex("4 episodes are not judged yet: evac rate new .*get no label\\)"));
  EXPECT_THAT(page("oracle"), Not(HasSubstr("get no label")));
}

TEST(Page, OnePairIsSaidInTheSingular) {
  const std::string page = ReportPage(SampleRun({{"a", "pick", "1", "s", "s"}}).Summary(), kBeside);
  EXPECT_THAT(page, HasSubstr("n = 1 pair. Exact McNemar"));
}

TEST(Page, ARunWithoutEpisodesOrWithoutARealWorldStillHasAPage) {
  RunData data = ReadRun(SampleRun({{"a", "pick", "1", "s", "s"}}).store());
  data.worlds[0].is_real = false;
  EXPECT_THAT(ReportPage(Summarise(data, {}), kBeside), HasSubstr("No world of this run is marked real"));
  data.episodes.clear();
  EXPECT_THAT(ReportPage(Summarise(data, {}), kBeside), HasSubstr("The run holds no episodes yet."));
}

TEST(Page, HasEverySectionThatTheRunCanFill) {
  const std::string page = ReportPage(LargeRun().Summary(), kBeside);
  for (const char* id : {"rates", "trust", "worlds", "states", "stages", "checkpoints", "judges", "clips", "errors",
                         "methods", "provenance"})
    EXPECT_THAT(page, HasSubstr(fmt::format("<section id=\"{}\"", id)));
  EXPECT_THAT(page, HasSubstr("uncalibrated")) << "only the oracle has judged";
}

TEST(Page, NoBarStandsWithoutItsInterval) {
  const std::string page = ReportPage(LargeRun().Summary(), kBeside);
  EXPECT_GT(Matches(page, "(class=\"dot\")").size(), 40u);
  EXPECT_EQ(Matches(page, "(<rect class=\"bar)").size(), 0u);
  const WorldMarks marks = MarksOf(LargeRun().Summary());
  for (const StageFunnel& funnel : StagesOf(LargeRun().Summary()).funnels) {
    const std::string chart = StageDrawing(funnel, marks).body;
    EXPECT_EQ(Matches(chart, "(class=\"dot\")").size() * 2, Matches(chart, "(h6)").size()) << "two ends for each dot";
  }
}

TEST(Html, EscapesWhatMarksUpAndWhatIsNoUtf8) {
  EXPECT_EQ(Escaped("<a href='x'>&\"ü€"), "&lt;a href=&#39;x&#39;&gt;&amp;&quot;ü€");
  EXPECT_EQ(Escaped(std::string("a\xff\xc0\x80z\x01", 6)), "a\xEF\xBF\xBD\xEF\xBF\xBD\xEF\xBF\xBDz\xEF\xBF\xBD");
}

TEST(Html, LongNamesMayBreakBetweenTheirParts) {
  EXPECT_EQ(Breakable("visual_pick@<1>"), "visual_<wbr>pick@<wbr>&lt;1&gt;");
}

TEST(Html, AnchorsOfDifferentNamesDiffer) {
  EXPECT_EQ(Anchor("a/b"), "a_2fb");
  EXPECT_NE(Anchor("a_2fb"), Anchor("a/b"));
}

TEST(Html, LinksKeepFoldersAndEncodeTheRest) {
  EXPECT_EQ(Link("videos/a b@1/c#d%?.mp4"), "videos/a%20b@1/c%23d%25%3F.mp4");
}

TEST(ReportPage, CarriesThumbnailsInsideWhenAskedTo) {
  PageOptions options = kBeside;
  options.embedded = [](const std::string& file) { return file.find("pick@1") == std::string::npos ? "" : "JPEG"; };
  const SampleRun run({{"a", "pick", "1", "sf", "sf"}, {"a", "pick", "2", "sf", "sf"}});
  const std::string page = ReportPage(run.Summary(), options);
  EXPECT_EQ(Matches(page, "(\"SlBFRw==\")").size(), 4U) << "of pick@1 in both worlds";
  EXPECT_THAT(ReportPage(run.Summary(), kBeside), Not(HasSubstr("SlBFRw==")));
}

TEST(Page, SaysWhatAskingModelServersTook) {
  const StoredRun run("asked", "sf", "sf");
  EXPECT_THAT(ReportPage(Summarise(ReadRun(run.store()), {}), kBeside), Not(HasSubstr("Calls to model servers")));
  {
    CallCache cache(run.folder() / CallCache::kFile);
    for (const char* status : {"ok", "ok", "timeout"})
      cache.Add({.key = "k",
                 .judge = "vlm:<b>",
                 .status = status,
                 .prompt_tokens = 1000,
                 .completion_tokens = 70,
                 .latency_ms = 1500,
                 .attempts = 2});
  }
  const std::string page = ReportPage(Summarise(ReadRun(run.store()), {}), kBeside);
  EXPECT_THAT(page, HasSubstr("Calls to model servers"));
  EXPECT_THAT(page, HasSubstr("<td>2 ok, 1 timeout</td><td class=\"num\">6</td><td class=\"num\">3000</td><td "
                              "class=\"num\">210</td><td class=\"num\">4.5</td>"));
  EXPECT_THAT(page, Not(HasSubstr("vlm:<b>")));
  EXPECT_TRUE(UnbalancedTags(page).empty());
}

}  // namespace
}  // namespace evac
