#pragma once

#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"

namespace evac {

/// OpenBLAS picks its kernels by the processor's model number when it is loaded, and takes its oldest for a number that
/// it does not know: a newer processor's programs are told what that one can. What the user says counts.
inline void TellOpenBlasTheProcessor() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512cd") && __builtin_cpu_supports("avx512bw") &&
      __builtin_cpu_supports("avx512dq") && __builtin_cpu_supports("avx512vl"))
    ::setenv("OPENBLAS_CORETYPE", "SKYLAKEX", 0);
#endif
}

/// This process becomes the program `name` that lies beside this one, and OpenBLAS there is told the processor.
/// @param arguments  without the program's name
/// @throws InternalError if it cannot be started.
[[noreturn]] inline void BecomeProgramBeside(const std::string& name, std::vector<std::string> arguments) {
  const std::string program = (std::filesystem::read_symlink("/proc/self/exe").parent_path() / name).string();
  std::vector<char*> words = {const_cast<char*>(program.c_str())};
  for (std::string& argument : arguments) words.push_back(argument.data());
  words.push_back(nullptr);
  TellOpenBlasTheProcessor();
  ::execv(program.c_str(), words.data());
  throw InternalError("cannot start {}: {}", program, std::strerror(errno));
}

}  // namespace evac
