#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>

#include "core/file.h"
#include "tests/support/command.h"
#include "tests/support/temp_folder.h"

/// `evac correlate --pairs` against published tables of real and simulated success rates.
namespace evac {
namespace {

using Json = nlohmann::json;

const std::filesystem::path kTables = std::filesystem::path(EVAC_SHARED_DIR) / "data/realsim_tables.json";
constexpr double kTolerance = 1e-4;

/// The tables' names of the conventions, as options of the command. "Strict sign" asks for opposite signs: a tie is no
/// violation. SIMPLER's README swaps the arguments of its function, which makes the gap that of the simulation.
const std::map<std::string, std::vector<std::string>> kConventions = {
    {"mmrv_strict_sign_realgap", {"--mmrv", "real_gap", "--ties", "sign"}},
    {"mmrv_simpler_code_gtxor_realgap", {}},
    {"mmrv_simpler_README_argswap_gtxor_simgap", {"--mmrv", "sim_gap", "--ties", "code"}},
    {"mmrv_leqxor_realgap", {"--mmrv", "real_gap", "--ties", "leq"}},
    {"mmrv_leqxor_simgap", {"--mmrv", "sim_gap", "--ties", "leq"}},
};

std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

/// "weaver/WEAVER-FT"; a table's rows that name no group are its group "all".
std::string GroupName(const Json& table, const std::string& group) {
  return table.at("id").get<std::string>() + "/" + group;
}

/// All tables in one file, as a spreadsheet would write it.
void WriteCsv(const Json& tables, const std::filesystem::path& path) {
  std::ofstream file(path);
  file << "policy,sim_sr,real_sr,task,group\r\n";
  for (const Json& table : tables) {
    for (const Json& row : table.at("rows")) {
      file << Quoted(row.at("policy")) << "," << row.at("sim_sr").dump() << "," << row.at("real_sr").dump() << ","
           << Quoted(row.value("task", "")) << "," << Quoted(GroupName(table, row.value("group", "all"))) << "\r\n";
    }
  }
}

std::map<std::string, Json> Correlate(const std::filesystem::path& csv, const std::vector<std::string>& options) {
  std::vector<std::string> words = {Binary("evac"), "correlate", "--pairs", csv.string(), "--json"};
  words.insert(words.end(), options.begin(), options.end());
  const CommandResult result = RunCommand(words);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(result.err, "");
  std::map<std::string, Json> groups;
  const Json answer = Json::parse(result.out);
  for (const Json& group : answer.at("groups")) groups[group.at("group")] = group;
  return groups;
}

void ExpectNear(const Json& got, const Json& want, const std::string& where) {
  ASSERT_TRUE(got.is_number()) << where << ": " << got;
  EXPECT_NEAR(got.get<double>(), want.get<double>(), kTolerance) << where;
}

void ExpectUndefined(const Json& group, const std::string& key, const std::string& where) {
  EXPECT_TRUE(group.at(key).is_null()) << where << " " << key;
  EXPECT_NE(group.at(key + "_reason"), "") << where << " " << key;
}

/// One group's answer in one convention; `want` is null for two points, which no correlation is computed from.
void ExpectReproduced(const Json& got, const Json& want, const std::string& convention) {
  const std::string where = got.at("group").get<std::string>() + " " + convention;
  if (want.is_null()) {
    ExpectUndefined(got, "pearson", where);
    ExpectUndefined(got, "spearman", where);
    return;
  }
  EXPECT_EQ(got.at("n"), want.at("n")) << where;
  ExpectNear(got.at("pearson"), want.at("pearson"), where);
  ExpectNear(got.at("spearman"), want.at("spearman_tie_avg"), where);
  ExpectNear(got.at("mmrv"), want.at(convention), where);
}

TEST(CorrelateCommand, ReproducesEveryPublishedTableInEveryConvention) {
  if (!std::filesystem::exists(kTables)) GTEST_SKIP() << kTables << " is not there";
  const TempFolder folder;
  std::ifstream stream(kTables);
  const Json tables = Json::parse(stream).at("datasets");
  WriteCsv(tables, folder / "rates.csv");
  for (const auto& [convention, options] : kConventions) {
    const std::map<std::string, Json> groups = Correlate(folder / "rates.csv", options);
    std::size_t reproduced = 0;
    for (const Json& table : tables) {
      for (const auto& [name, want] : table.at("recomputed_by_us").items()) {
        ASSERT_TRUE(groups.contains(GroupName(table, name))) << GroupName(table, name);
        ExpectReproduced(groups.at(GroupName(table, name)), want, convention);
        ++reproduced;
      }
    }
    EXPECT_EQ(reproduced, groups.size());
  }
}

TEST(ReportCommand, ShowsEveryPublishedTableWithTheNumbersOfCorrelate) {
  if (!std::filesystem::exists(kTables)) GTEST_SKIP() << kTables << " is not there";
  const TempFolder folder;
  std::ifstream stream(kTables);
  const Json tables = Json::parse(stream).at("datasets");
  WriteCsv(tables, folder / "rates.csv");
  const CommandResult result = RunCommand({Binary("evac"), "report", "--pairs", (folder / "rates.csv").string(), "--out",
                                           (folder / "report").string()});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const std::string page = ReadFile(folder / "report" / "index.html");
  std::map<std::string, Json> groups;
  const Json written = Json::parse(ReadFile(folder / "report" / "correlation.json"));
  for (const Json& group : written.at("groups")) groups[group.at("group")] = group;
  for (const Json& table : tables) {
    for (const auto& [name, want] : table.at("recomputed_by_us").items()) {
      const std::string group = GroupName(table, name);
      ExpectReproduced(groups.at(group), want, "mmrv_simpler_code_gtxor_realgap");
      if (want.is_null()) continue;
      const std::string shown = fmt::format("<td class=\"num big\">{:.2f}", want.at("pearson").get<double>());
      EXPECT_NE(page.find(shown), std::string::npos) << group << " " << shown;
    }
  }
  EXPECT_FALSE(std::filesystem::is_empty(folder / "report" / "charts"));
}

TEST(ReportCommand, WantsARunOrATable) {
  EXPECT_EQ(RunCommand({Binary("evac"), "report"}).exit_code, 2);
  EXPECT_EQ(RunCommand({Binary("evac"), "report", "run", "--pairs", "rates.csv", "--out", "out"}).exit_code, 2);
}

TEST(ReportCommand, AFolderThatCannotBeMadeIsNamed) {
  const TempFolder folder;
  const std::string table = (folder / "rates.csv").string();
  std::ofstream(table) << "group,task,policy,real_sr,sim_sr\n,t,a,0.2,0.5\n";
  const CommandResult result =
      RunCommand({Binary("evac"), "report", "--pairs", table, "--out", table + "/page"});
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_NE(result.err.find("evac: " + table + ": cannot be made: "), std::string::npos) << result.err;
}

TEST(CorrelateCommand, WarnsOnStderrAndRefusesWithCodeTwo) {
  const TempFolder folder;
  std::ofstream(folder / "high.csv") << "group,task,policy,real_sr,sim_sr\n,t,a,85,80\n";
  const CommandResult high =
      RunCommand({Binary("evac"), "correlate", "--pairs", (folder / "high.csv").string(), "--json"});
  EXPECT_EQ(high.exit_code, 0);
  EXPECT_NE(high.err.find("high.csv:2: column real_sr is 85"), std::string::npos) << high.err;
  EXPECT_TRUE(Json::parse(high.out).at("groups").at(0).at("pearson").is_null());

  std::ofstream(folder / "bad.csv") << "group,task,policy,real_sr,sim_sr\n,t,a,x,80\n";
  const CommandResult bad = RunCommand({Binary("evac"), "correlate", "--pairs", (folder / "bad.csv").string()});
  EXPECT_EQ(bad.exit_code, 2);
  EXPECT_EQ(bad.out, "");
  EXPECT_NE(bad.err.find("bad.csv:2: column real_sr: found \"x\""), std::string::npos) << bad.err;
}

}  // namespace
}  // namespace evac
