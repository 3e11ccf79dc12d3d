#include "worldmodel/sim/scene_page.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>
#include <utility>

#include "core/config.h"
#include "core/file.h"
#include "core/geometry.h"

namespace evac::sim {
namespace {

constexpr double kFloorBelowTableM = 0.75;  // scenes/robot.xml

std::vector<double> ReadNumbers(const Config& page, const std::string& key, std::size_t count) {
  auto numbers = page.Get<std::vector<double>>(key);
  const bool finite = std::all_of(numbers.begin(), numbers.end(), [](double number) { return std::isfinite(number); });
  page.Require(numbers.size() == count && finite, key, fmt::format("{} finite numbers", count));
  return numbers;
}

Range ReadRange(const Config& page, const std::string& key) {
  const auto ends = ReadNumbers(page, key, 2);
  page.Require(ends[0] <= ends[1], key, "[low, high] with low <= high");
  return {ends[0], ends[1]};
}

Home ReadHome(const Config& page) {
  page.AllowOnly({"inside", "position_m", "quat_xyzw", "closure"});
  const auto xyz = ReadNumbers(page, "position_m", 3);
  const auto quat = ReadNumbers(page, "quat_xyzw", 4);
  const bool unit = std::abs(Eigen::Vector4d(quat.data()).norm() - 1) < 1e-3;
  page.Require(unit, "quat_xyzw", "four numbers x, y, z, w of length 1");
  Home home{page.Get<std::string>("inside", ""),
            FromXyzQuat({xyz[0], xyz[1], xyz[2]}, {quat[0], quat[1], quat[2], quat[3]}),
            page.Get<double>("closure", 0.0)};
  page.Require(home.closure >= 0 && home.closure <= 1, "closure", "0 open … 1 closed");
  return home;
}

/// One arm's home stands in the section itself, two arms' under their names.
std::vector<Home> ReadHomes(const Config& page, const Task& task) {
  if (task.arms.size() == 1) return {ReadHome(page)};
  if (page.Has("position_m"))
    throw InvalidInput("{}: found {} arms, wanted [right]: the home here is one arm's", page.Where(), task.arms.size());
  page.AllowOnly({"left", "right"});
  std::vector<Home> homes;
  for (const std::string& arm : task.arms) homes.push_back(ReadHome(page.Section(arm)));
  return homes;
}

Placement ReadPlacement(const Config& page) {
  page.AllowOnly({"body", "inside", "x_m", "y_m", "z_m", "yaw_deg"});
  Placement placement;
  placement.body = page.Get<std::string>("body");
  placement.inside = page.Get<std::string>("inside", "");
  placement.x_m = ReadRange(page, "x_m");
  placement.y_m = ReadRange(page, "y_m");
  placement.z_m = page.Get<double>("z_m");
  placement.yaw_deg = ReadRange(page, "yaw_deg");
  return placement;
}

ColourVariation ReadColour(const Config& page) {
  page.AllowOnly({"materials", "hue_deg", "saturation", "value"});
  return {page.Get<std::vector<std::string>>("materials"), ReadRange(page, "hue_deg"), ReadRange(page, "saturation"),
          ReadRange(page, "value")};
}

LightVariation ReadLight(const Config& page) {
  page.AllowOnly({"strength", "azimuth_deg", "warmth"});
  return {ReadRange(page, "strength"), ReadRange(page, "azimuth_deg"), ReadRange(page, "warmth")};
}

Clutter ReadClutter(const Config& page) {
  page.AllowOnly({"bodies", "chance", "places_m", "spread_m"});
  Clutter clutter;
  clutter.bodies = page.Get<std::vector<std::string>>("bodies");
  clutter.chance = page.Get<double>("chance");
  page.Require(clutter.chance >= 0 && clutter.chance <= 1, "chance", "a probability");
  for (const Config& place : page.List("places_m")) {
    const auto xy = place.Value<std::vector<double>>();
    place.Require(xy.size() == 2, "", "two numbers [x, y]");
    clutter.places_m.emplace_back(xy[0], xy[1]);
  }
  page.Require(clutter.places_m.size() >= clutter.bodies.size(), "places_m", "at least as many places as bodies");
  clutter.spread_m = page.Get<double>("spread_m");
  return clutter;
}

/// The files of every `<include file="…"/>` of a MuJoCo scene, either kind of quote.
std::vector<std::string> IncludedFiles(const std::string& xml) {
  static constexpr std::string_view kTag = "<include", kBlank = " \t\r\n", kBeforeValue = " \t\r\n=";
  std::vector<std::string> files;
  for (std::size_t tag = xml.find(kTag); tag != std::string::npos; tag = xml.find(kTag, tag + 1)) {
    const std::size_t name = xml.find_first_not_of(kBlank, tag + kTag.size());
    if (name == std::string::npos || xml.compare(name, 4, "file") != 0) continue;
    const std::size_t open = xml.find_first_not_of(kBeforeValue, name + 4);
    if (open == std::string::npos || (xml[open] != '"' && xml[open] != '\'')) continue;
    const std::size_t close = xml.find(xml[open], open + 1);
    if (close != std::string::npos) files.push_back(xml.substr(open + 1, close - open - 1));
  }
  return files;
}

/// A suite's hash covers the files that a page names; so a page must name all that its scene is made of.
void RequireIncludesNamed(const Config& page, const std::vector<std::string>& named,
                          const std::filesystem::path& scene) {
  for (const std::string& file : IncludedFiles(ReadFile(scene))) {
    if (std::find(named.begin(), named.end(), file) != named.end()) continue;
    throw InvalidInput("{}: {} includes '{}', wanted that file in the list", page.Where("includes"), scene.string(),
                       file);
  }
}

}  // namespace

ScenePage ReadScenePage(const Task& task) {
  const Config task_page = Config::FromText(task.page, task.page_path);
  if (!task_page.Has("mujoco"))
    throw InvalidInput("{}: found no section 'mujoco', wanted one: see docs/add_a_task.md", task.page_path);
  const Config page = task_page.Section("mujoco");
  page.AllowOnly({"scene", "includes", "home", "objects", "colours", "light", "clutter"});
  ScenePage scene;
  scene.scene = page.Path("scene");
  const auto named = page.Get<std::vector<std::string>>("includes", std::vector<std::string>{});
  RequireIncludesNamed(page, named, scene.scene);
  for (const std::string& file : named) RequireIncludesNamed(page, named, scene.scene.parent_path() / file);
  scene.homes = ReadHomes(page.Section("home"), task);
  for (const Config& item : page.List("objects")) {
    Placement placement = ReadPlacement(item);
    const bool is_new = std::ranges::find(scene.placements, placement.body, &Placement::body) == scene.placements.end();
    item.Require(is_new, "body", "another body than those before it");
    scene.placements.push_back(std::move(placement));
  }
  for (const Config& item : page.List("colours")) scene.colours.push_back(ReadColour(item));
  scene.light = ReadLight(page.Section("light"));
  scene.clutter = ReadClutter(page.Section("clutter"));
  return scene;
}

Task WithoutObject(const Task& task, const std::string& body) {
  Config page = Config::FromText(task.page, task.page_path);
  const std::vector<Config> objects = page.Section("mujoco").List("objects");
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const Placement placement = ReadPlacement(objects[i]);
    if (placement.body != body) continue;
    const std::string quoted = nlohmann::json(body).dump();  // YAML reads JSON's texts
    page.Set(fmt::format("mujoco.objects.{}={{body: {}, x_m: [3, 3], y_m: [-3, -3], z_m: {}, yaw_deg: [{}, {}]}}", i,
                         quoted, placement.z_m - kFloorBelowTableM, placement.yaw_deg.low, placement.yaw_deg.high));
    Task without = task;
    without.page = page.Text();
    return without;
  }
  throw InvalidInput("{}: found no object '{}' to take away", page.Where("mujoco.objects"), body);
}

}  // namespace evac::sim
