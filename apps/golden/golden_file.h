#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "core/tensor_file.h"
#include "worldmodel/nn/model_config.h"
#include "worldmodel/nn/tensor.h"

/// Folders of golden vectors: what the reference answered to recorded inputs. Sizes come from each file's own metadata.
namespace evac::golden {

using at::Tensor;

/// One file: its tensors by name, its numbers, its model.
class GoldenFile {
 public:
  explicit GoldenFile(const std::filesystem::path& path);

  const std::filesystem::path& path() const { return path_; }
  bool Has(const std::string& name) const { return file_.Has(name); }
  /// @throws TensorError if it is not there.
  Tensor Get(const std::string& name) const;
  std::vector<std::string> Names() const;
  /// Those that begin and end so: {"ex0", "ex1"} for (".raw").
  std::vector<std::string> PrefixesOf(const std::string& suffix) const;
  /// The recorded random numbers, in the order they were drawn.
  std::vector<Tensor> Noise() const;

  bool HasModel() const { return file_.metadata().contains("model"); }
  /// A number of the metadata, or `otherwise`.
  double Number(const std::string& key, double otherwise) const;
  /// The sizes that the metadata states. @throws TensorError if it states none, or they make no network.
  nn::ModelConfig Model() const;

 private:
  std::filesystem::path path_;
  TensorFile file_;
};

/// How far what we computed is from what was recorded, over all tensors of a file.
class Comparison {
 public:
  /// Each entry within `tolerance` of the recorded tensor's largest magnitude, or of 1 if that is smaller.
  void Close(const std::string& name, const Tensor& got, const Tensor& wanted, double tolerance);
  /// Each entry within `tolerance`, in the tensor's own unit.
  void Within(const std::string& name, const Tensor& got, const Tensor& wanted, double tolerance);
  /// Every entry the same.
  void Same(const std::string& name, const Tensor& got, const Tensor& wanted) { Within(name, got, wanted, 0); }

  int count() const { return static_cast<int>(entries_.size()); }
  double worst() const { return worst_; }  ///< largest error, relative as in Close, or in units as in Within
  /// "chunk0.samples: error 2.3e-06, at most 2e-05" for each tensor, in the order they were compared.
  std::vector<std::string> Each() const;
  double rms() const;
  /// What failed, with numbers.
  const std::vector<std::string>& failures() const { return failures_; }
  bool Passed() const { return failures_.empty() && !entries_.empty(); }

 private:
  void Add(const std::string& name, const Tensor& error, double scale, double tolerance);

  struct Entry {
    std::string name;
    double error = 0, tolerance = 0;
  };
  std::vector<Entry> entries_;
  double worst_ = 0, squares_ = 0, numbers_ = 0;
  std::vector<std::string> failures_;
};

inline constexpr double kModuleTolerance = 2e-5;
inline constexpr double kGuidedTolerance = 1e-3;  ///< guidance of 7.5 multiplies rounding
inline constexpr double kTrainTolerance = 1e-4;

}  // namespace evac::golden
