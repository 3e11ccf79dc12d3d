#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "worldmodel/nn/mapped_tensors.h"
#include "worldmodel/train/flat_parameters.h"

/// What is trained on (docs/formats/shards.md): mapped files, so a data set may be larger than memory.
namespace evac::train {

/// One crop of one recording: rows `first` … `first + frames - 1` of a shard.
struct Clip {
  std::size_t shard = 0;
  std::int64_t first = 0, frames = 0;
  std::int32_t task = 0;     ///< of the set's `tasks`
  std::int8_t outcome = -1;  ///< 1 success, 0 failure, -1 unknown
};

/// The same scene again, told something else (`evac vary`): seen by nobody but in the clip's first picture.
struct Variant {
  std::size_t shard = 0;
  std::int64_t picture = 0;            ///< the row of the shard whose picture it begins with
  std::int64_t first = 0, frames = 0;  ///< rows of the shard's variants
  std::int8_t outcome = -1;
};

/// The tensors of one file, F frames of V views.
struct Shard {
  std::filesystem::path path;
  Tensor clip_start;          ///< [clips + 1] long
  Tensor task, outcome;       ///< [clips] int, char
  Tensor frames, maps;        ///< [F, V, H, W, 3] bytes
  Tensor actions;             ///< [F, 16]
  Tensor deltas;              ///< [F, 14]
  Tensor c2w;                 ///< [F, V, 4, 4] base_from_camera
  Tensor k;                   ///< [F, V, 3, 3] pixels of the stored picture
  Tensor object_px;           ///< [F, V, 2], not a number where unknown
  Tensor contact;             ///< [F] bytes
  Tensor variant_actions, variant_object_px;  ///< [R, 16], [R, V, 2]; undefined before OpenVariants, and where there are none
  Tensor latents, map_latents;  ///< [F, V, z, h, w] half, scaled; undefined before OpenLatents
};

enum class Split { kTrain, kHoldout };

/// What `evac pack` wrote, each packing in a folder of its own. One that is named twice is in a set twice, and so drawn
/// from twice as often.
using ShardFolders = std::vector<std::filesystem::path>;

/// Each folder once, where it is named first, whether it is named again, with a '/' behind it or by a link: what is
/// measured with counts once, however often it is drawn from.
ShardFolders EachOnce(const ShardFolders& folders);

class ShardSet {
 public:
  /// @throws TensorError naming the file and what was found and wanted: packing not done, shards that are missing, none of
  ///   this split, a tensor that is missing or misshapen, another version, shards of different pictures, periods, cameras,
  ///   statistics or kinds of arms; a shard of no clips or of pictures without a pixel, with other than one camera's name
  ///   per view, with unknown arms, with an outcome that is none, or with actions, deltas, c2w or k that are not finite
  ShardSet(const ShardFolders& folders, Split split);
  ShardSet(const std::filesystem::path& folder, Split split) : ShardSet(ShardFolders{folder}, split) {}

  /// @param z  latent channels
  /// @param stride  of the codec, pixels
  /// @param scale_factor  of the page; empty: not asked
  /// @throws TensorError if a shard has no latents yet, they are of another size, of different codecs, were made of
  ///   another file than shards.json says the shard is, or say that they were multiplied by another factor
  void OpenLatents(std::int64_t z, std::int64_t stride, std::optional<double> scale_factor = {});

  /// Reads the variants of the shards, where there are some.
  /// @throws TensorError if they are of another packing, misshapen, of clips that are not there, with an outcome that
  ///   is none, or with actions that are not finite; or if one shard of a folder has none while others have, or has
  ///   them of another count or seed
  void OpenVariants();

  /// @throws TensorError if what shards of one set must share (see the constructor) is otherwise in the other split
  void CheckLike(const ShardSet& other) const { CheckSame(other.shards_.front().path.string(), other.metadata_); }

  Split split() const { return split_; }
  std::string FolderNames() const;  ///< with commas between them
  const std::vector<Variant>& variants() const { return variants_; }
  const std::vector<Shard>& shards() const { return shards_; }
  const std::vector<Clip>& clips() const { return clips_; }
  /// Of all its shards: period_s, cameras, arms, arms_read (where one says it), pose_map, delta_frames, statistics; and
  /// those of the folders with commas between them: recipe, tasks.
  const TensorMetadata& metadata() const { return metadata_; }
  std::int64_t views() const { return shards_.front().frames.size(1); }
  std::int64_t height_px() const { return shards_.front().frames.size(2); }
  std::int64_t width_px() const { return shards_.front().frames.size(3); }
  std::int64_t frame_count() const;
  /// SHA-256 of the codec whose latents are open.
  const std::string& codec() const { return codec_; }
  /// What the open latents were computed with, of each shard; once where that is the same of all.
  const std::vector<std::string>& products() const { return products_; }
  /// The open latents in few letters: trainings on others are told apart by it. Empty: none are open.
  std::string LatentsIdentity() const;
  /// Of all bytes of the open variants' files: other variants have another. 0: there are none.
  std::uint64_t variants_hash() const { return variants_hash_; }

 private:
  void Add(const std::filesystem::path& path, Split split);
  void CheckSame(const std::string& name, const TensorMetadata& metadata) const;

  ShardFolders folders_;
  Split split_;
  std::vector<Shard> shards_;
  std::vector<Clip> clips_;
  std::vector<Variant> variants_;
  std::vector<std::string> tasks_;
  TensorMetadata metadata_;
  std::string codec_;
  std::vector<std::string> products_;
  std::uint64_t variants_hash_ = 0;
};

/// `scale_factor` as latents' metadata says it.
std::string ScaleText(double scale_factor);
/// Whether latents were multiplied by this, or do not say by what (those of earlier versions).
bool MayBeScaledBy(const TensorMetadata& latents, double scale_factor);
/// The file of the latents that belong to a shard.
std::filesystem::path LatentsPath(const std::filesystem::path& shard);
/// The file of its variants.
std::filesystem::path VariantsPath(const std::filesystem::path& shard);
/// The `recipe` of each packing, with commas between them, as ShardSet's metadata have it.
/// @throws TensorError as ShardPaths, or if a first shard has none
std::string RecipesOf(const ShardFolders& folders);
/// Whether a packing has shards of a split. @throws TensorError as ShardPaths
bool HasSplit(const std::filesystem::path& folder, Split split);
/// Every shard of a folder, in order.
/// @throws TensorError if the packing is not done, naming shards that it should have and lacks, or one that is not its own
std::vector<std::filesystem::path> ShardPaths(const std::filesystem::path& folder);

/// Bytes [N, H, W, 3] → [N, 3, H, W] in [-1, 1].
Tensor PicturesFrom(const Tensor& bytes);

}  // namespace evac::train
