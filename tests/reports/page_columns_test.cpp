#include "reports/page_columns.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

namespace evac {
namespace {

constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";

/// What page/data.js does.
std::vector<std::string> Read(const nlohmann::ordered_json& column, std::size_t rows) {
  const std::string digits = column.at("s");
  const auto width = column.at("w").get<std::size_t>();
  std::vector<std::string> values;
  for (std::size_t i = 0; i < rows; ++i) {
    std::size_t value = 0;
    for (std::size_t place = 0; place < width; ++place) value = value * 64 + kDigits.find(digits.at(i * width + place));
    values.push_back(column.at("v").at(value));
  }
  EXPECT_EQ(digits.size(), rows * width);
  return values;
}

std::vector<std::string> Read(const TextColumn& text, std::size_t rows, std::size_t most_bytes) {
  const nlohmann::ordered_json json = text.Json(most_bytes);
  std::vector<std::string> sentences = Read(json.at("column"), rows);
  std::istringstream lines(json.at("numbers").is_null() ? "" : json.at("numbers").get<std::string>());
  for (std::string& sentence : sentences) {
    std::string line;
    std::getline(lines, line);
    std::istringstream numbers(line);
    for (std::size_t at = sentence.find('\x01'); at != std::string::npos; at = sentence.find('\x01', at)) {
      std::string number = "…";
      numbers >> number;
      sentence.replace(at, 1, number);
    }
  }
  return sentences;
}

TEST(Column, GivesBackWhatWasAddedWhateverTheWidth) {
  for (const int different : {1, 64, 65, 4096, 5000}) {
    Column column;
    std::vector<std::string> wanted;
    for (int i = 0; i < 2 * different; ++i) {
      wanted.push_back("value " + std::to_string(i % different));
      column.Add(wanted.back());
    }
    EXPECT_EQ(Read(column.Json(), wanted.size()), wanted) << different;
  }
}

TEST(TextColumn, SentencesThatDifferInNumbersShareTheirWords) {
  TextColumn text;
  const std::vector<std::string> wanted = {"grasp at 2.9 s, lift at 3 s", "grasp at 12 s, lift at 0.25 s", "",
                                           "v1.2.3 done."};
  for (const std::string& sentence : wanted) text.Add(sentence);
  EXPECT_EQ(Read(text, wanted.size(), 1000), wanted);
  EXPECT_EQ(text.Json(1000).at("column").at("v").size(), 3u);
}

TEST(TextColumn, WhatDoesNotFitLosesItsNumbersThenItsDetailsThenAllAndSaysSo) {
  TextColumn text;
  for (int i = 0; i < 100; ++i)
    text.Add("grasp failed; nearest at " + std::to_string(i) + ".5 s by " +
             std::string(1, static_cast<char>('a' + i % 20)));
  EXPECT_EQ(text.Json(100000).at("cut"), "");
  EXPECT_EQ(text.Json(1000).at("cut"), "numbers");
  EXPECT_THAT(Read(text, 100, 1000)[3], "grasp failed; nearest at … s by d");
  EXPECT_EQ(text.Json(300).at("cut"), "clauses");
  EXPECT_THAT(Read(text, 100, 300)[3], "grasp failed");
  EXPECT_EQ(text.Json(10).at("cut"), "all");
  EXPECT_THAT(Read(text, 100, 10)[3], "");
}

TEST(TextColumn, AClauseIsNotCutInsideALetter) {
  TextColumn text;
  std::string umlauts;
  for (int i = 0; i < 60; ++i) umlauts += "ü";
  for (int i = 0; i < 50; ++i) text.Add("x" + umlauts + std::string(static_cast<std::size_t>(i), '.'));
  const std::string clause = Read(text, 50, 400)[0];
  EXPECT_EQ(clause.size() % 2, 1u) << "one x and whole umlauts";
  EXPECT_LE(clause.size(), 80u);
}

TEST(ForScript, NothingEndsTheScriptBeforeItsEnd) {
  EXPECT_EQ(ForScript({{"a", "</script><!--"}}), R"({"a":"\u003c/script>\u003c!--"})");
  EXPECT_EQ(ForScript({{"a", "\xff"}}), "{\"a\":\"\xEF\xBF\xBD\"}");
}

}  // namespace
}  // namespace evac
