#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <vector>

/// How 10^5 episodes fit into a page: a column is a list of what occurs and, per row, a number in a few digits to the
/// base 64. page/data.js reads it.
namespace evac {

/// One value per row, of few different ones. `Json` gives {"v": [values, in order of first appearance], "w": digits per
/// row, "s": the rows' digits}; of one value alone the rows need none: "w" is 0 and "s" empty.
class Column {
 public:
  void Add(const std::string& value);
  nlohmann::ordered_json Json() const;
  const std::vector<std::string>& values() const { return values_; }
  const std::vector<std::uint32_t>& rows() const { return rows_; }

 private:
  std::map<std::string, std::uint32_t, std::less<>> index_;
  std::vector<std::string> values_;
  std::vector<std::uint32_t> rows_;
};

/// One sentence per row. Sentences differ in their numbers more than in their words, so that the words are a column,
/// "reach at \x01 s", and the numbers stand apart. Where both would be larger than `most_bytes` the numbers are left
/// out
/// ("…" is shown in their place), and where the words alone are, all but their first clause, and then that too.
class TextColumn {
 public:
  void Add(std::string_view text);
  /// {"column": as above, "numbers": "2.1 3\n0.5\n…" or null}; what was left out is said by "cut": "", "numbers",
  /// "clauses", "all".
  nlohmann::ordered_json Json(std::size_t most_bytes) const;

 private:
  Column words_, clauses_;
  std::string numbers_;
};

/// JSON inside <script>: no '<' that could end it.
std::string ForScript(const nlohmann::ordered_json& json);

}  // namespace evac
