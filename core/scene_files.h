#pragma once

#include <filesystem>
#include <vector>

namespace evac {

/// The files that a MuJoCo scene is made of besides itself: what it and its includes name as `file`, `fileright`, … of
/// an element (includes, meshes, textures, height fields, attached models), in the scene's folder or below what
/// `meshdir`, `texturedir` and `assetdir` say, without their own folders too where `strippath` is "true". An include is
/// known by its content and may have any name. Those that are there, each once, in order; what is missing MuJoCo
/// refuses.
/// @throws InvalidInput if a file cannot be read.
std::vector<std::filesystem::path> FilesOfScene(const std::filesystem::path& scene);

}  // namespace evac
