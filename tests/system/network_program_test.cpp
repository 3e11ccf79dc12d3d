#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/command.h"

namespace evac {
namespace {

using testing::HasSubstr;
using testing::Not;

/// What the dynamic linker would load for it.
std::string LibrariesOf(const std::string& program) {
  return RunCommand({"/usr/bin/env", "LD_TRACE_LOADED_OBJECTS=1", Binary(program)}).out;
}

TEST(NetworkProgram, IsTheOnlyOneThatLoadsLibtorch) {
  for (const std::string program : {"evac", "evac-policy", "evac-draw"})
    EXPECT_THAT(LibrariesOf(program), testing::AllOf(HasSubstr("libstdc++"), Not(HasSubstr("libtorch")))) << program;
  for (const std::string program : {"evac-networks", "evac-policy-learned"})
    EXPECT_THAT(LibrariesOf(program), HasSubstr("libtorch")) << program;
}

TEST(NetworkProgram, IsTheSameProgramToItsUser) {
  using Words = std::vector<std::string>;
  for (const Words& words : {Words{"--help"},
                             {"train", "-h"},
                             {"judge", "train", "--help"},
                             {"judge", "-h"},
                             {"weights"},
                             {"--version"},
                             {"weights", "inspect", "no such file.safetensors"},
                             {"weights", "inspect", ""},
                             {"encode", "--colour", "red"},
                             {"judge", "no such run", "--judge", "classifier", "--weights", "none.safetensors"}}) {
    Words light = words, networks = words;
    light.insert(light.begin(), Binary("evac"));
    networks.insert(networks.begin(), Binary("evac-networks"));
    const CommandResult one = RunCommand(light), other = RunCommand(networks);
    EXPECT_EQ(one.exit_code, other.exit_code) << testing::PrintToString(words);
    EXPECT_EQ(one.out, other.out) << testing::PrintToString(words);
    EXPECT_EQ(one.err, other.err) << testing::PrintToString(words);
    EXPECT_FALSE(one.out.empty() && one.err.empty());
  }
}

}  // namespace
}  // namespace evac
