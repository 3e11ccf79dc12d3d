// What nearly every file includes by way of core/types.h, compiled once per module (evac_precompile in cmake/evac.cmake):
// a third of a clean build. No file may rely on it: each includes what it uses, which the asan build, without it, proves.
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
