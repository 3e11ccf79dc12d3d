// What campaigns of fuzzing begin with, and what they found worth keeping (docs/fuzzing.md), without the fuzzer.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "core/file.h"
#include "tests/support/temp_folder.h"

int MakeFuzzCorpus(int argc, char** argv);  // tests/fuzz/make_corpus.cpp

extern "C" {
#define EVAC_FUZZ_TARGET(name) int name(const std::uint8_t* data, std::size_t size);
#include <fuzz_targets.inc>
#undef EVAC_FUZZ_TARGET

/// libFuzzer's own, which a target's mutator calls and nothing here does.
std::size_t LLVMFuzzerMutate(std::uint8_t*, std::size_t size, std::size_t) { return size; }
}

namespace evac {
namespace {

namespace fs = std::filesystem;

const fs::path kCorpus = fs::path(EVAC_SOURCE_DIR) / "tests/fuzz/corpus";

struct Target {
  const char* name;
  int (*take)(const std::uint8_t* data, std::size_t size);
};

const std::vector<Target> kTargets = {
#define EVAC_FUZZ_TARGET(name) {#name, ::name},
#include <fuzz_targets.inc>
#undef EVAC_FUZZ_TARGET
};

void PrintTo(const Target& target, std::ostream* out) { *out << target.name; }

/// A target that finds something wrong ends the process: the input's name is said then. (A handler sees nothing else.)
std::string g_input;
void SayInput(int) { (void)!::write(STDERR_FILENO, g_input.data(), g_input.size()); }

void Take(const Target& target, const std::string& bytes, const std::string& what) {
  g_input = std::string(target.name) + " is ended by " + what + "\n";
  EXPECT_EQ(target.take(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()), 0) << g_input;
}

/// The valid inputs that a campaign starts from, by target.
const fs::path& Seeds() {
  static const TempFolder folder;
  static const int made = [] {
    std::string program = "make_corpus", place = folder.path().string();
    char* words[] = {program.data(), place.data()};
    return MakeFuzzCorpus(2, words);
  }();
  EXPECT_EQ(made, 0);
  return folder.path();
}

class Corpus : public testing::TestWithParam<Target> {
 protected:
  Corpus() { ::signal(SIGABRT, SayInput); }
  ~Corpus() override { ::signal(SIGABRT, SIG_DFL); }
};

TEST_P(Corpus, IsReadOrRefusedFileByFile) {
  Take(GetParam(), "", "nothing at all");
  std::set<fs::path> files;
  for (const fs::path& corpus : {kCorpus, Seeds()}) {
    const fs::path folder = corpus / GetParam().name;
    if (!fs::exists(folder)) continue;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder)) files.insert(entry.path());
  }
  EXPECT_FALSE(files.empty()) << "wanted a seed in tests/fuzz/make_corpus.cpp";
  for (const fs::path& file : files) Take(GetParam(), ReadFile(file), file.string());
}

INSTANTIATE_TEST_SUITE_P(Of, Corpus, testing::ValuesIn(kTargets),
                         [](const testing::TestParamInfo<Target>& info) { return std::string(info.param.name); });

TEST(Corpora, EachIsATargets) {
  std::set<std::string> known, found;
  for (const Target& target : kTargets) known.insert(target.name);
  for (const fs::directory_entry& entry : fs::directory_iterator(kCorpus)) found.insert(entry.path().filename());
  EXPECT_GT(found.size(), 10u);
  for (const std::string& name : found) EXPECT_THAT(known, testing::Contains(name));
}

}  // namespace
}  // namespace evac
