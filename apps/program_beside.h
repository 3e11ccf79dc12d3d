#pragma once

#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"
#include "worldmodel/nn/open_blas.h"

namespace evac {

/// This process becomes the program `name` that lies beside this one, and OpenBLAS there is told the processor.
/// @param arguments  without the program's name
/// @throws InternalError if it cannot be started.
[[noreturn]] inline void BecomeProgramBeside(const std::string& name, std::vector<std::string> arguments) {
  const std::string program = (std::filesystem::read_symlink("/proc/self/exe").parent_path() / name).string();
  std::vector<char*> words = {const_cast<char*>(program.c_str())};
  for (std::string& argument : arguments) words.push_back(argument.data());
  words.push_back(nullptr);
  nn::TellOpenBlasTheProcessor();
  ::execv(program.c_str(), words.data());
  throw InternalError("cannot start {}: {}", program, std::strerror(errno));
}

}  // namespace evac
