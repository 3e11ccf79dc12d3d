#include "worldmodel/train/sha256.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>

#include "core/hash.h"
#include "tests/train/prepared_world.h"

namespace evac::train {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

std::string Bytes(std::size_t size) {
  std::string bytes;
  for (std::size_t i = 0; i < size; ++i) bytes += static_cast<char>(i * i + 7 * i);
  return bytes;
}

TEST(Sha256, IsThatOfTheRestOfEvacWhateverTheSizeAndThePieces) {
  for (std::size_t size = 0; size < 260; ++size) {
    const std::string bytes = Bytes(size);
    Sha256 whole, pieces;
    whole.Add(bytes);
    for (std::size_t at = 0; at < size; at += 37) pieces.Add(std::string_view(bytes).substr(at, 37));
    const std::string wanted = Sha256Hex(bytes);
    EXPECT_EQ(whole.Hex(), wanted) << size;
    EXPECT_EQ(pieces.Hex(), wanted) << size;
  }
}

TEST(Sha256, OfAFileIsThatOfItsBytes) {
  const TempFolder folder;
  const std::string bytes = Bytes(200'001);
  std::ofstream(folder / "file", std::ios::binary) << bytes;
  EXPECT_EQ(Sha256OfFile(folder / "file"), Sha256Hex(bytes));
  for (const char* none : {"nowhere", "."})
    EXPECT_THAT([&] { Sha256OfFile(folder / none); },
                ThrowsMessage<TensorError>(HasSubstr((folder / none).string() + ": cannot be read")));
}

/// Latents that were made by earlier versions say it: it may not change.
TEST(CodecSha256, IsOfNamesShapesAndFloatsInTheOrderOfTheNames) {
  const Prepared at(1);
  const TensorFile file = TensorFile::Open(at.codec());
  std::map<std::string, std::string> tensors;
  for (const TensorView& tensor : file.tensors()) {
    if (!tensor.name.starts_with("first_stage_model")) continue;
    std::string& text = tensors[tensor.name] = tensor.name + " ";
    for (std::size_t i = 0; i < tensor.shape.size(); ++i) text += (i == 0 ? "" : ",") + std::to_string(tensor.shape[i]);
    text += "\n";
    text.append(reinterpret_cast<const char*>(tensor.bytes.data()), tensor.bytes.size());
  }
  ASSERT_GT(tensors.size(), 10u);
  std::string all;
  for (const auto& [name, text] : tensors) all += text;
  EXPECT_EQ(CodecSha256(at.codec()), Sha256Hex(all));
  WriteTensorFile(at.folder / "none", {}, {});
  EXPECT_THAT([&] { CodecSha256(at.folder / "none"); }, ThrowsMessage<TensorError>(HasSubstr("it holds no codec")));
}

}  // namespace
}  // namespace evac::train
