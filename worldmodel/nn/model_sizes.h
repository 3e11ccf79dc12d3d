#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "worldmodel/nn/model_config.h"

/// Every size of the network by name, whatever the page or file that it is read from.
namespace evac::nn {

/// A field of somebody's ModelConfig.
struct Size {
  std::string section;  ///< "unet", as on the page of sizes; empty: it stands on the page itself
  std::string name;     ///< "model_channels"
  std::variant<std::int64_t*, std::vector<std::int64_t>*, double*, std::optional<double>*, bool*> field;

  /// "unet.model_channels"
  std::string Key() const { return section.empty() ? name : section + "." + name; }
};

/// All of them, those of a section together, in the order of apps/configs/evac_published.yaml.
std::vector<Size> SizesOf(ModelConfig& config);

/// What a size says: "320", "1,2,4,4", "0.18215", "true"; all digits of a number. Empty: an optional one that is not
/// there, or a list of none.
std::string TextOf(const Size& size);
/// The other way round. @returns false, with the size as it was, if the text says no such thing
bool SetFromText(const Size& size, const std::string& text);

}  // namespace evac::nn
