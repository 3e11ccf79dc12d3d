// What nearly every file includes by way of core/types.h, compiled once per module (evac_precompile in cmake/evac.cmake):
// half of what a small file costs to compile. No file may rely on it: each includes what it uses, which the asan build, made without it, shows.
#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>
