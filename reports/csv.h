#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace evac {

struct CsvRow {
  int line = 0;  ///< where it begins, from 1
  std::vector<std::string> cells;
};

/// Splits text into rows of cells (RFC 4180; a line may also end with CR alone). Empty lines and a UTF-8 byte order
/// mark are skipped. Keeps views of both arguments.
class CsvReader {
 public:
  /// @param file  what messages call the text.
  CsvReader(std::string_view text, const std::string& file);

  /// The next row that is not an empty line, or nothing at the end.
  /// @throws InvalidInput "FILE:LINE: column N: …" for a quote that is never closed, or text after a closing one.
  std::optional<CsvRow> Next();

 private:
  bool AtLineEnd() const { return text_[place_] == '\n' || text_[place_] == '\r'; }
  void SkipLineEnd();
  std::string Cell(const CsvRow& row);
  std::string QuotedCell(const CsvRow& row);

  std::string_view text_;
  const std::string& file_;
  std::size_t place_ = 0;
  int line_ = 1;
};

/// The cells as one row of RFC 4180, ended by LF: quoted where a comma, a quote, a line end or an outer blank asks for
/// it, so that CsvReader gives back the same cells.
std::string CsvLine(const std::vector<std::string>& cells);

/// Without blanks around it.
std::string_view Trimmed(std::string_view cell);
/// As a message shows it: in quotes, cut after 60 bytes.
std::string Quoted(std::string_view cell);

}  // namespace evac
