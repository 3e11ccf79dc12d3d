#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <utility>

namespace evac {

/// What every `evac` command ends with.
enum class ExitCode {
  kOk = 0,            ///< done
  kNo = 1,            ///< the answer is "no": a gate failed
  kInvalidInput = 2,  ///< the user's file, field or option is wrong
  kInconclusive = 3,  ///< neither yes nor no
  kInternal = 4,      ///< our fault, the machine's (disk full), the error budget is spent, or interrupted
};

/// The one exception type of the project. Thrown with the values in the message; caught around an episode, at C
/// callbacks, and in `main`, which prints `what()` and ends with `exit_code()`.
class Error : public std::runtime_error {
 public:
  Error(ExitCode exit_code, const std::string& message) : std::runtime_error(message), exit_code_(exit_code) {}
  ExitCode exit_code() const { return exit_code_; }

  /// The same error with a word for its kind, by which the errors of many files are counted: "short_video".
  /// @param kind  lives as long as the program: a literal.
  Error Called(const char* kind) const {
    Error named = *this;
    named.kind_ = kind;
    return named;
  }
  const char* kind() const { return kind_; }  ///< "" where nobody counts

 private:
  ExitCode exit_code_;
  const char* kind_ = "";
};

/// `throw InvalidInput("{}: image.height_px is {}, wanted a multiple of 2", file, found);`
template <typename... Args>
Error InvalidInput(fmt::format_string<Args...> format, Args&&... args) {
  return Error(ExitCode::kInvalidInput, fmt::format(format, std::forward<Args>(args)...));
}

/// For what is not the user's doing: a full disk, a library that refuses, a broken invariant.
template <typename... Args>
Error InternalError(fmt::format_string<Args...> format, Args&&... args) {
  return Error(ExitCode::kInternal, fmt::format(format, std::forward<Args>(args)...));
}

}  // namespace evac
