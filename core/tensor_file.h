#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

/// Tensors in files: the safetensors format (https://huggingface.co/docs/safetensors, "Format"), little-endian.
/// Standard library and POSIX only, so that the network builds alone with a compiler and libtorch.
namespace evac {

/// What is wrong with tensors or the file that holds them, in one sentence that names the file. The only exception of
/// this header and of `worldmodel/nn`; `main` treats it like InvalidInput, but for what the next one says.
class TensorError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The machine did not take what was written (a full disk): nobody's tensors are wrong. `main` treats it like
/// InternalError.
class TensorWriteError : public TensorError {
 public:
  using TensorError::TensorError;
};

enum class TensorType : std::uint8_t { kBool, kU8, kI8, kI16, kI32, kI64, kF16, kBF16, kF32, kF64 };
std::size_t BytesOf(TensorType type);
/// "BOOL", "U8", …, "F64": the format's own names.
const char* Name(TensorType type);

/// What a tensor is, without its numbers.
struct TensorDeclaration {
  std::string name;
  TensorType type = TensorType::kF32;
  std::vector<std::int64_t> shape;  ///< row-major; empty: a single number
  /// @throws TensorError if the size in bytes is beyond 2^62.
  std::size_t ByteCount() const;
};

/// A tensor in somebody's memory. `bytes` need not be aligned to the type.
struct TensorView : TensorDeclaration {
  std::span<const std::byte> bytes;
};

using TensorMetadata = std::map<std::string, std::string>;

/// An open file of tensors, mapped, not read: opening costs the header alone, whatever the size.
class TensorFile {
 public:
  /// @throws TensorError naming the file: not there, cut off, a header that is none, that lies about sizes, overlaps,
  ///   leaves gaps, names a tensor twice, or is longer than 100 MB.
  static TensorFile Open(const std::filesystem::path& path);
  /// The same from bytes in memory; `name` stands for the file in messages.
  static TensorFile Parse(std::string bytes, const std::string& name);
  /// A file of torch.save: a zip of a pickle and its storages. Nothing of the pickle is executed: it is read by a list
  /// of what a checkpoint needs (docs/weights.md). The tensors are those of its `state_dict` (Lightning), else of its
  /// `module` without "_forward_module." (DeepSpeed), else of the whole, in their order there.
  /// @throws TensorError naming the file and what in it is refused.
  static TensorFile OpenTorch(const std::filesystem::path& path);
  static TensorFile ParseTorch(std::string bytes, const std::string& name);
  /// Either kind, told by the first bytes.
  static TensorFile OpenCheckpoint(const std::filesystem::path& path);

  TensorFile(TensorFile&& other) noexcept;
  TensorFile& operator=(TensorFile&& other) noexcept;
  ~TensorFile();

  const std::string& name() const { return name_; }
  /// All of the file, header and padding included; where the tensors' bytes lie, but for those of a .pt that were not
  /// laid out row by row there.
  std::span<const std::byte> bytes() const { return bytes_; }
  const TensorMetadata& metadata() const { return metadata_; }
  /// In the order of their bytes.
  const std::vector<TensorView>& tensors() const { return tensors_; }
  bool Has(const std::string& tensor) const { return by_name_.contains(tensor); }
  /// @throws TensorError naming file and tensor if it is not there.
  const TensorView& Get(const std::string& tensor) const;
  /// The system may forget the pages of this tensor, which were copied elsewhere; they can still be read again.
  void LetGo(const TensorView& tensor) const;

 private:
  TensorFile() = default;
  void Map(const std::filesystem::path& path);
  void Own(std::string bytes, const std::string& name);
  void ReadHeader();
  void ReadTorch();
  void Unmap();

  std::string name_;
  std::unique_ptr<std::string> owned_;  ///< the bytes of Parse, at one place for ever
  std::vector<std::vector<std::byte>> repacked_;
  std::span<const std::byte> bytes_;  ///< all of the file
  void* mapping_ = nullptr;
  TensorMetadata metadata_;
  std::vector<TensorView> tensors_;
  std::map<std::string, std::size_t> by_name_;
};

/// Writes a file of declared tensors piece by piece: what is larger than memory can be written.
///   TensorFileWriter writer(path, declarations, metadata);
///   for (…) writer.Append(bytes of the next tensor, in the order of the declarations);
///   writer.Finish();   // until then there is no file at `path`
/// A link stays one: written is the file that it leads to.
/// What processes of this machine left of the same path when they were killed is removed.
class TensorFileWriter {
 public:
  /// @throws TensorError if there can be no such file (a folder that is missing or is none, no right to write there, what
  ///   is there is no regular file); TensorWriteError with the system's reason (disk full).
  TensorFileWriter(const std::filesystem::path& path, std::span<const TensorDeclaration> tensors,
                   const TensorMetadata& metadata);
  TensorFileWriter(const TensorFileWriter&) = delete;
  TensorFileWriter& operator=(const TensorFileWriter&) = delete;
  ~TensorFileWriter();

  /// @throws TensorError for more bytes than were declared; TensorWriteError with the system's reason (disk full).
  void Append(std::span<const std::byte> bytes);
  /// Syncs and renames. @throws TensorError unless exactly the declared bytes were written, or if `path` is a folder;
  ///   TensorWriteError as Append.
  void Finish();

 private:
  void Write(const void* bytes, std::size_t count);

  std::filesystem::path path_, partial_;
  int file_ = -1;
  std::size_t missing_ = 0;  ///< bytes still to come
};

/// All at once. The same tensors and metadata give the same bytes. @throws as TensorFileWriter.
void WriteTensorFile(const std::filesystem::path& path, std::span<const TensorView> tensors,
                     const TensorMetadata& metadata);

}  // namespace evac
