#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>

#include "core/tensor_file.h"
#include "core/tensor_file_pickle.h"

/// The files were written by CPython's own pickle and zipfile: tests/support/torch_checkpoint.py --corpus.
namespace evac {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const fs::path kFiles = fs::path(EVAC_SOURCE_DIR) / "tests/fuzz/corpus/checkpoint_fuzz";

std::string BytesOf(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::vector<float> Floats(const TensorView& tensor) {
  std::vector<float> values(tensor.bytes.size() / sizeof(float));
  if (!values.empty()) std::memcpy(values.data(), tensor.bytes.data(), tensor.bytes.size());
  return values;
}

std::string RefusalOf(const std::string& file) {
  try {
    TensorFile::OpenCheckpoint(kFiles / file);
  } catch (const TensorError& error) {
    return error.what();
  }
  return "nothing was thrown";
}

std::string PickleRefusal(const std::string& pickle) {
  try {
    ReadPickle(std::as_bytes(std::span(pickle)), "test");
  } catch (const TensorError& error) {
    return error.what();
  }
  return "nothing was thrown";
}

class Layouts : public ::testing::TestWithParam<const char*> {};

TEST_P(Layouts, AllGiveTheSameTensors) {
  const TensorFile file = TensorFile::OpenCheckpoint(kFiles / GetParam());
  std::vector<std::string> names;
  for (const TensorView& tensor : file.tensors()) names.push_back(tensor.name);
  EXPECT_THAT(names, ElementsAre("w", "part", "turned", "halves", "one", "none"));
  EXPECT_THAT(file.Get("w").shape, ElementsAre(4, 6));
  EXPECT_EQ(Floats(file.Get("w"))[23], 23);
  EXPECT_THAT(Floats(file.Get("part")), ElementsAre(18, 19, 20, 21, 22, 23));
  EXPECT_THAT(Floats(file.Get("one")), ElementsAre(5));
  EXPECT_TRUE(file.Get("one").shape.empty());
  EXPECT_EQ(file.Get("halves").type, TensorType::kBF16);
  EXPECT_EQ(file.Get("none").ByteCount(), 0u);
  EXPECT_EQ(file.metadata().at("layout"), GetParam());
}
INSTANTIATE_TEST_SUITE_P(Torch, Layouts, ::testing::Values("state_dict", "module", "plain"),
                         [](const auto& info) { return std::string(info.param); });

TEST(TorchFile, TensorsThatAreTurnedInTheirStorageAreLaidOutRowByRow) {
  const TensorFile file = TensorFile::OpenTorch(kFiles / "plain");
  EXPECT_THAT(file.Get("turned").shape, ElementsAre(6, 4));
  const std::vector<float> values = Floats(file.Get("turned"));
  ASSERT_EQ(values.size(), 24u);
  for (std::size_t row = 0; row < 6; ++row) {
    for (std::size_t column = 0; column < 4; ++column)
      EXPECT_EQ(values[row * 4 + column], static_cast<float>(column * 6 + row));
  }
}

TEST(TorchFile, TensorsStayWhereTheyAreWhenTheFileIsMoved) {
  TensorFile file = TensorFile::ParseTorch(BytesOf(kFiles / "plain"), "bytes");
  TensorFile moved = std::move(file);
  EXPECT_EQ(Floats(moved.Get("w"))[23], 23);
  EXPECT_EQ(Floats(moved.Get("turned"))[23], 23);
}

TEST(TorchFile, AHostilePickleIsRefusedByTheNameItCallsAndNothingIsExecuted) {
  fs::remove("/tmp/evac_was_executed");
  EXPECT_THAT(RefusalOf("hostile"), AllOf(HasSubstr("hostile: pickle, byte"), HasSubstr("'posix.system'"),
                                          HasSubstr("nothing was executed")));
  EXPECT_FALSE(fs::exists("/tmp/evac_was_executed"));
}

TEST(TorchFile, EveryRefusalSaysWhatAndWhere) {
  EXPECT_THAT(RefusalOf("beyond"), HasSubstr("'w' is larger than its storage or reaches beyond it"));
  EXPECT_THAT(RefusalOf("repeated"), HasSubstr("'w' is larger than its storage or reaches beyond it"));
  EXPECT_THAT(RefusalOf("lost"), HasSubstr("'w' lies in storage '0', which is not there"));
  EXPECT_THAT(RefusalOf("short"), HasSubstr("storage '0' claims 24 numbers of 4 bytes, and has 92 bytes"));
  EXPECT_THAT(RefusalOf("nested"),
              HasSubstr("'model' is no tensor; wanted a dict of tensors, or one under 'state_dict'"));
  EXPECT_THAT(RefusalOf("list"), HasSubstr("its pickle is no dict"));
  EXPECT_THAT(RefusalOf("protocol4"), HasSubstr("protocol 4, wanted 2"));
  EXPECT_THAT(RefusalOf("compressed"), HasSubstr("'archive/data.pkl' is compressed"));
  EXPECT_THAT(RefusalOf("legacy"), HasSubstr("before 1.6"));
  EXPECT_THAT(RefusalOf("not_there"), HasSubstr("cannot open"));
}

std::string Little(std::size_t number, std::size_t bytes) {
  std::string text;
  for (std::size_t i = 0; i < bytes; ++i, number >>= 8) text += static_cast<char>(number & 0xff);
  return text;
}

/// A zip of that pickle alone.
std::string Zipped(const std::string& pickle) {
  const std::string name = "a/data.pkl", size = Little(pickle.size(), 4);
  const std::string local =
      "PK\x03\x04" + Little(0, 14) + size + size + Little(name.size(), 2) + Little(0, 2) + name + pickle;
  const std::string central = "PK\x01\x02" + Little(0, 16) + size + size + Little(name.size(), 2) + Little(0, 16) + name;
  return local + central + "PK\x05\x06" + Little(0, 4) + Little(1, 2) + Little(1, 2) + Little(central.size(), 4) +
         Little(local.size(), 4) + Little(0, 2);
}

/// A key of a megabyte that a pickle recalled for 20 000 tensors was copied for each before the first was refused.
TEST(TorchFile, AKeyThatIsThereTwiceOrLongIsRefusedBeforeTheNextIsRead) {
  std::string file = BytesOf(kFiles / "plain");
  file.replace(file.find("turned"), 6, "halves");
  file.replace(file.find("K\x05))"), 4, "K\x7f))");  // 'one' reaches beyond its storage
  const auto refusal = [](const std::string& bytes) -> std::string {
    try {
      TensorFile::ParseTorch(bytes, "test");
    } catch (const TensorError& error) {
      return error.what();
    }
    return "nothing was thrown";
  };
  EXPECT_THAT(refusal(file), HasSubstr("tensor 'halves' is there twice"));
  const auto with_key = [](std::size_t bytes) {
    return Zipped("\x80\x02}X" + Little(bytes, 4) + std::string(bytes, 'k') + "Ns.");
  };
  EXPECT_THAT(refusal(with_key(1025)), HasSubstr("a key of 1025 bytes, wanted at most 1024"));
  EXPECT_THAT(refusal(with_key(1024)), HasSubstr("is no tensor")) << "it is read";
}

TEST(TorchFile, CutOffAnywhereItEndsInAMessage) {
  const std::string whole = BytesOf(kFiles / "state_dict");
  for (std::size_t size = 0; size < whole.size(); ++size)
    EXPECT_THROW(TensorFile::ParseTorch(whole.substr(0, size), "cut"), TensorError) << size;
}

TEST(TorchFile, WithAnyByteChangedItIsAFileOrAMessage) {
  const std::string whole = BytesOf(kFiles / "module");
  int refused = 0;
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::string changed = whole;
    changed[at] = static_cast<char>(changed[at] ^ 0xff);
    try {
      const TensorFile file = TensorFile::ParseTorch(changed, "changed");
      for (const TensorView& tensor : file.tensors()) EXPECT_EQ(tensor.bytes.size(), tensor.ByteCount());
    } catch (const TensorError&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 100);
}

TEST(Pickle, OfAnotherKindIsRefusedByItsOpcode) {
  EXPECT_THAT(PickleRefusal("\x80\x02i__main__\nThing\n."), HasSubstr("opcode 0x69 is none that torch.save writes"));
  EXPECT_THAT(PickleRefusal("\x80\x02\x82\x01."), HasSubstr("opcode 0x82"));  // a callable by number
  EXPECT_THAT(PickleRefusal("\x80\x02"
                            "cbuiltins\neval\n."),
              HasSubstr("'builtins.eval'"));
}

TEST(Pickle, ThatMisusesItsStackIsRefused) {
  EXPECT_THAT(PickleRefusal("\x80\x02."), HasSubstr("ends with 0 values"));
  EXPECT_THAT(PickleRefusal("\x80\x02R."), HasSubstr("takes more from its stack"));
  EXPECT_THAT(PickleRefusal("\x80\x02}(Na."), HasSubstr("wanted a list"));
  EXPECT_THAT(PickleRefusal("\x80\x02}(Nu."), HasSubstr("a key without a value"));
  EXPECT_THAT(PickleRefusal("\x80\x02t."), HasSubstr("a mark is missing"));
  EXPECT_THAT(PickleRefusal("\x80\x02h\x07."), HasSubstr("recalls what it never remembered"));
  EXPECT_THAT(PickleRefusal("\x80\x02" + std::string(2000, '(')), HasSubstr("nested deeper than 1000"));
  EXPECT_THAT(PickleRefusal("\x80\x02X\xff\xff\xff\x7f"), HasSubstr("cut off"));
  EXPECT_THAT(PickleRefusal("\x80\x02"
                            "ctorch\nFloatStorage\n)R."),
              HasSubstr("calls what is no callable"));
}

TEST(Pickle, MayHoldItself) {
  EXPECT_EQ(PickleRefusal("\x80\x02]q\x01h\x01"
                          "a."),
            "nothing was thrown");
}

}  // namespace
}  // namespace evac
