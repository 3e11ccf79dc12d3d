#pragma once

#include <string>
#include <vector>

/// What the architecture rules need to know about C++ text. Not a parser: a lexer that knows comments, strings and
/// braces.
namespace evac::architecture {

/// The same text, byte for byte as long and with the same line breaks, with every comment, string, character literal
/// and preprocessor line blanked: what is left has only the braces that the compiler sees.
std::string CodeOnly(const std::string& text);

struct FunctionSpan {
  std::string head;    ///< "void Store::Add(const EpisodeRecord& record)", white space collapsed
  int first_line = 0;  ///< 1-based, where the head begins (`template` included)
  int last_line = 0;   ///< of the closing brace
  int Lines() const { return last_line - first_line + 1; }
};

/// Every function body at namespace or class scope, in the order of the text. Lambdas and local classes count as lines
/// of the function around them.
std::vector<FunctionSpan> FindFunctions(const std::string& text);

struct Include {
  std::string path;
  bool quoted = false;  ///< "ours.h", else <theirs.h>
  int line = 0;
};
std::vector<Include> FindIncludes(const std::string& text);

}  // namespace evac::architecture
