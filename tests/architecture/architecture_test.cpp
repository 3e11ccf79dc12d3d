#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/architecture/rules.h"
#include "tests/architecture/source_text.h"

namespace evac::architecture {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::SizeIs;

std::string Lines(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += "  ++steps;\n";
  return text;
}

Violations InTree(Violations (*rule)(const SourceFile&), bool cpp_only) {
  const std::vector<SourceFile> files = ReadTree(EVAC_SOURCE_DIR);
  EXPECT_GT(files.size(), 20u) << "no sources below " << EVAC_SOURCE_DIR;
  Violations all;
  for (const SourceFile& file : files) {
    if (cpp_only && !IsCpp(file.path)) continue;
    for (std::string& violation : rule(file)) all.push_back(std::move(violation));
  }
  return all;
}

std::string Listed(const Violations& violations) {
  std::string text = "\n";
  for (const std::string& violation : violations) text += "  " + violation + "\n";
  return text;
}

// ---- the tree keeps the rules

TEST(Tree, EveryFileIncludesOnlyItsOwnModuleAndCore) {
  const Violations found = InTree(BrokenIncludeArrows, true);
  EXPECT_THAT(found, IsEmpty()) << Listed(found);
}

TEST(Tree, LibavSqliteAndTorchHaveOneHomeEach) {
  const Violations found = InTree(MisplacedLibraries, true);
  EXPECT_THAT(found, IsEmpty()) << Listed(found);
}

TEST(Tree, NoFileAndNoFunctionIsTooLong) {
  const Violations found = InTree(TooLong, true);
  EXPECT_THAT(found, IsEmpty()) << Listed(found);
}

TEST(Tree, NothingNamesAPathOfOneMachine) {
  const Violations found = InTree(MachinePaths, false);
  EXPECT_THAT(found, IsEmpty()) << Listed(found);
}

TEST(Tree, NothingNamesASectionOfADocumentThatIsNotHere) {
  const Violations found = InTree(MissingSources, false);
  EXPECT_THAT(found, IsEmpty()) << Listed(found);
}

TEST(Tree, ScriptsAreReadToo) {
  std::vector<std::string> paths;
  for (const SourceFile& file : ReadTree(EVAC_SOURCE_DIR)) paths.push_back(file.path);
  EXPECT_THAT(paths, testing::Contains("tests/support/torch_checkpoint.py"));
}

TEST(Tree, TheTopHoldsOnlyTheFoldersItShould) {
  const Violations found = UnknownTopFolders(TopFolders(EVAC_SOURCE_DIR));
  EXPECT_THAT(found, IsEmpty()) << Listed(found);
}

// ---- and the rules can fail

TEST(IncludeArrows, ASiblingIsRefusedWithFileLineAndRule) {
  const Violations found =
      BrokenIncludeArrows({"reports/page.cpp", "#include \"core/store.h\"\n\n#include \"judges/oracle_judge.h\"\n"});
  EXPECT_THAT(found, ElementsAre(HasSubstr("reports/page.cpp:3: reports may not include judges/oracle_judge.h")));
}

TEST(IncludeArrows, CoreIncludesNobody) {
  EXPECT_THAT(BrokenIncludeArrows({"core/store.cpp", "#include \"reports/summary.h\"\n"}), SizeIs(1));
  EXPECT_THAT(BrokenIncludeArrows({"core/store.cpp", "#include <apps/commands.h>\n"}), SizeIs(1))
      << "angle brackets are no way around";
}

TEST(IncludeArrows, AppsAndTestsMayIncludeEverything) {
  EXPECT_THAT(BrokenIncludeArrows({"apps/factory.cpp", "#include \"policies/lcm_policy.h\"\n"}), IsEmpty());
  EXPECT_THAT(BrokenIncludeArrows({"tests/system/demo_test.cpp", "#include \"worldmodel/sim/mujoco_world.h\"\n"}),
              IsEmpty());
}

TEST(IncludeArrows, TheNetworkKnowsNoRobots) {
  EXPECT_THAT(BrokenIncludeArrows({"worldmodel/nn/unet.h", "#include \"core/types.h\"\n"}), SizeIs(1));
  EXPECT_THAT(BrokenIncludeArrows({"worldmodel/nn/unet.h", "#include \"worldmodel/train/trainer.h\"\n"}), SizeIs(1));
  EXPECT_THAT(BrokenIncludeArrows({"worldmodel/nn/weights.h", "#include \"core/tensor_file.h\"\n"}), IsEmpty());
  EXPECT_THAT(BrokenIncludeArrows({"worldmodel/train/trainer.h", "#include \"worldmodel/nn/unet.h\"\n"}), IsEmpty());
  EXPECT_THAT(BrokenIncludeArrows({"worldmodel/evac_world.cpp", "#include \"worldmodel/nn/unet.h\"\n"}), IsEmpty());
}

TEST(IncludeArrows, PhysicsStandsAlone) {
  EXPECT_THAT(BrokenIncludeArrows({"worldmodel/sim/mujoco_world.cpp", "#include \"worldmodel/echo_world.h\"\n"}),
              SizeIs(1));
  EXPECT_THAT(BrokenIncludeArrows({"worldmodel/evac_world.cpp", "#include \"worldmodel/sim/mujoco_world.h\"\n"}),
              SizeIs(1));
  EXPECT_THAT(BrokenIncludeArrows({"worldmodel/sim/mujoco_world.cpp",
                                   "#include \"worldmodel/sim/arm.h\"\n#include \"core/world.h\"\n"}),
              IsEmpty());
}

TEST(IncludeArrows, OurHeadersAreNamedFromTheRoot) {
  EXPECT_THAT(BrokenIncludeArrows({"core/store.cpp", "#include \"store.h\"\n"}), SizeIs(1));
  EXPECT_THAT(BrokenIncludeArrows({"core/store.cpp", "#include \"../reports/page.h\"\n"}), SizeIs(1));
}

TEST(Libraries, EachIsRefusedAwayFromItsHome) {
  EXPECT_THAT(MisplacedLibraries({"core/store.cpp", "extern \"C\" {\n#include <libavcodec/avcodec.h>\n}\n"}),
              ElementsAre(HasSubstr("core/store.cpp:2:")));
  EXPECT_THAT(MisplacedLibraries({"core/video_writer.cpp", "#include <libswscale/swscale.h>\n"}), IsEmpty());
  EXPECT_THAT(MisplacedLibraries({"harness/rollout.cpp", "#include <sqlite3.h>\n"}), SizeIs(1));
  EXPECT_THAT(MisplacedLibraries({"core/store_schema.cpp", "#include <sqlite3.h>\n"}), IsEmpty());
  EXPECT_THAT(MisplacedLibraries({"worldmodel/evac_world.cpp", "#include <torch/torch.h>\n"}), SizeIs(1));
  EXPECT_THAT(MisplacedLibraries({"worldmodel/nn/unet.cpp", "#include <torch/torch.h>\n"}), IsEmpty());
  EXPECT_THAT(MisplacedLibraries({"judges/classifier_net.cpp", "#include <ATen/core/Tensor.h>\n"}), IsEmpty());
  EXPECT_THAT(MisplacedLibraries({"judges/oracle_judge.cpp", "#include <ATen/core/Tensor.h>\n"}), SizeIs(1));
}

TEST(Sizes, AFileOf501LinesIsTooLong) {
  std::string text;
  for (int i = 0; i < 500; ++i) text += "// one\n";
  EXPECT_THAT(TooLong({"core/a.cpp", text}), IsEmpty());
  EXPECT_THAT(TooLong({"core/a.cpp", text + "// one\n"}), ElementsAre(HasSubstr("core/a.cpp:501: 501 lines")));
}

TEST(Sizes, AFunctionOf61LinesIsTooLong) {
  EXPECT_THAT(TooLong({"core/a.cpp", "void Fits() {\n" + Lines(58) + "}\n"}), IsEmpty());
  EXPECT_THAT(TooLong({"core/a.cpp", "\nvoid DoesNot() {\n" + Lines(59) + "}\n"}),
              ElementsAre(HasSubstr("core/a.cpp:2: 61 lines in 'void DoesNot()'")));
  EXPECT_THAT(TooLong({"tests/a_test.cpp", "TEST(A, B) {\n" + Lines(59) + "}\n"}), SizeIs(1))
      << "tests are functions too";
}

TEST(Sizes, AFunctionIsFoundWhereverItStands) {
  const std::string body = " {\n" + Lines(59) + "}\n";
  EXPECT_THAT(
      TooLong({"a.h", "namespace evac {\nnamespace {\nclass A final : public B {\n public:\n  int F() const override" +
                          body + "};\n}\n}\n"}),
      SizeIs(1));
  EXPECT_THAT(TooLong({"a.h", "A::A(int x) : a_{x}, b_(x), C<int>{x}" + body}), SizeIs(1));
  EXPECT_THAT(TooLong({"a.h", "template <typename T = std::map<int, int>>\nauto F(T t = {}) -> std::vector<T>" + body}),
              SizeIs(1));
  EXPECT_THAT(TooLong({"a.h", "bool operator==(const A& a, const A& b)" + body}), SizeIs(1));
  EXPECT_THAT(
      TooLong({"a.h", "struct A {\n  int x = 0;\n  std::vector<int> y{1, 2};\n  void operator()(int z) noexcept" +
                          body + "};\n"}),
      SizeIs(1));
  EXPECT_THAT(TooLong({"a.h", "struct Pair Make()" + body}), SizeIs(1));
}

TEST(Sizes, ATableIsNoFunction) {
  EXPECT_THAT(TooLong({"a.cpp", "const std::array<int, 99> kTable = {\n" + Lines(99) + "};\n"}), IsEmpty());
  EXPECT_THAT(TooLong({"a.cpp", "constexpr auto kTable = Make({\n" + Lines(99) + "});\n"}), IsEmpty());
  EXPECT_THAT(TooLong({"a.h", "struct Options {\n" + Lines(99) + "};\n"}), IsEmpty());
}

TEST(Lexer, BracesInStringsCommentsAndRawStringsAreNotBraces) {
  const std::vector<FunctionSpan> found = FindFunctions(
      "void A() {\n  // }\n  /* } \n } */\n  f(\"}\\\"}\", '}', '\\'', 1'000'000);\n"
      "  g(R\"css(\n } \" }\n)css\");\n}\n#define OPEN {{ \\\n  {{\nvoid B() {}\n");
  ASSERT_THAT(found, SizeIs(2));
  EXPECT_EQ(found[0].head, "void A()");
  EXPECT_EQ(found[0].last_line, 9);
  EXPECT_EQ(found[1].first_line, 12);
}

TEST(Lexer, TheTextKeepsItsLengthAndItsLines) {
  const std::string text = "int a; // one\nconst char* b = R\"(x\ny)\";\n/* c\n*/ int d;\n";
  const std::string code = CodeOnly(text);
  EXPECT_EQ(code.size(), text.size());
  EXPECT_EQ(code, "int a;       \nconst char* b =     \n   ;\n    \n   int d;\n");
}

TEST(MachinePath, IsFoundWithItsLine) {
  const std::string home = std::string("/") + "home";
  EXPECT_THAT(MachinePaths({"docs/a.md", "one\nsee " + home + "/me/evac\n"}), ElementsAre(HasSubstr("docs/a.md:2:")));
  EXPECT_THAT(MachinePaths({"docs/a.md", "out/home/me, https://a.org" + home + "/x, $X" + home + "/y\n"}), IsEmpty());
}

TEST(MissingSource, IsFoundWithItsLine) {
  const std::string page = std::string("statistics.md") + " 3.4", section = std::string("(EVAC; spec") + " 4.6)";
  EXPECT_THAT(MissingSources({"core/a.h", "one\n/// Association (" + page + ").\n"}),
              ElementsAre(HasSubstr("core/a.h:2:")));
  EXPECT_THAT(MissingSources({"docs/a.md", section + "\n" + page + "\n"}), SizeIs(2));
  EXPECT_THAT(MissingSources({"core/a.h", "docs/statistics.md, rates.md 1, EVAC, Sec. 3.2, the spec of 2 cameras\n"}),
              IsEmpty());
}

TEST(TopFolder, AnUnknownOneIsRefused) {
  EXPECT_THAT(UnknownTopFolders({"core", "utils"}), ElementsAre(HasSubstr("utils/:1:")));
}

}  // namespace
}  // namespace evac::architecture
