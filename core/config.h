#pragma once

#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <initializer_list>
#include <span>
#include <string>
#include <vector>

#include "core/error.h"

namespace evac {

/// A YAML mapping (or one item of a list) that knows where it stands, so that every complaint names file, line, field, what was
/// found and what was wanted. Unknown keys are errors that name the nearest known one.
///
///   Config page = Config::FromFile("profile.yaml");
///   page.AllowOnly({"friction", "light"});
///   const double friction = page.Get<double>("friction");
///   const int count = page.Get<int>("count", 1);              // with a default
///   for (const Config& camera : page.List("cameras")) …
class Config {
 public:
  /// @throws InvalidInput if the file cannot be read or is no YAML mapping.
  static Config FromFile(const std::filesystem::path& path);
  /// @param name  stands for the file in messages; relative paths are relative to its folder.
  static Config FromText(const std::string& text, const std::filesystem::path& name);

  /// `--set path.to.field=VALUE`: VALUE is YAML; a number picks an item of a list ("policies.0.checkpoint=a").
  /// Sections on the way that are not there are made; whether there may be such is for AllowOnly to say.
  /// @throws InvalidInput for an item that no list has, for a field of what is no mapping, or if an alias in the file
  /// makes the field one with another.
  void Set(const std::string& assignment);

  bool Has(const std::string& key) const;
  /// @throws InvalidInput if there is no such field, or it is not a T (bool, int, double, std::string, std::uint64_t, std::vector<…>).
  template <typename T>
  T Get(const std::string& key) const;
  template <typename T>
  T Get(const std::string& key, const T& otherwise) const;

  /// A sub-mapping; `Section` throws if it is absent, `List` returns nothing (items may be scalars: see `Value`).
  Config Section(const std::string& key) const;
  std::vector<Config> List(const std::string& key) const;
  /// The item itself, as a T.
  template <typename T>
  T Value() const;
  /// The keys of the mapping, in the file's order.
  std::vector<std::string> Keys() const;

  /// A path field: relative ones are relative to the file's folder; not checked for existence.
  std::filesystem::path Path(const std::string& key) const;

  /// @throws InvalidInput naming the first key that is not among `known`, and the known one nearest to it.
  void AllowOnly(std::initializer_list<const char*> known) const { AllowOnly(std::span(known.begin(), known.size())); }
  void AllowOnly(std::span<const char* const> known) const;

  /// "FILE:LINE: field a.b.c" for messages about a field of this mapping: `throw InvalidInput("{}: found …, wanted …", Where("c"))`.
  std::string Where(const std::string& key = "") const;
  /// Checks a value: `page.Require(count > 0, "count", "a positive number")`. The message holds the value found.
  void Require(bool holds, const std::string& key, const std::string& wanted) const;

  const std::filesystem::path& file() const { return file_; }
  /// Canonical text: the same for the same content, whatever the comments or the layout of the file. What is hashed.
  std::string Canonical() const;
  /// SHA-256 of Canonical().
  std::string ContentHash() const;
  /// As YAML again, with what was set; without the comments.
  std::string Text() const;
  const YAML::Node& node() const { return node_; }

 private:
  Config(YAML::Node node, std::filesystem::path file, std::string field);
  YAML::Node Child(const std::string& key) const;
  std::string FieldName(const std::string& key) const;
  template <typename T>
  T Converted(const std::string& key, const YAML::Node& node) const;
  [[noreturn]] void ThrowWrongType(const std::string& key, const YAML::Node& found, const char* wanted) const;

  YAML::Node node_;
  std::filesystem::path file_;
  std::string field_;  ///< "worlds.0", empty at the top
};

}  // namespace evac
