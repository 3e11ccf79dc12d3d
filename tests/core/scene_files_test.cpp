#include "core/scene_files.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/file.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

using ::testing::ElementsAre;

class SceneFiles : public ::testing::Test {
 protected:
  std::filesystem::path Write(const std::string& name, const std::string& text) {
    std::filesystem::create_directories((folder_ / name).parent_path());
    WriteFileAtomically(folder_ / name, text);
    return folder_ / name;
  }
  std::vector<std::string> Found(const std::filesystem::path& scene) {
    std::vector<std::string> names;
    for (const auto& file : FilesOfScene(scene)) names.push_back(file.lexically_relative(folder_.path()).string());
    return names;
  }
  TempFolder folder_;
};

TEST_F(SceneFiles, IncludesMeshesAndTexturesOfIncludedFilesToo) {
  const auto scene = Write("scene.xml", R"(<mujoco model="a"><include file='robot.xml'/><option timestep = "0.002"/></mujoco>)");
  Write("robot.xml", R"(<mujoco><compiler meshdir="meshes" texturedir="skins"/><asset>
    <mesh name="hand" file = "hand.stl"/><texture type="cube" fileright="wood.png" file="missing.png"/></asset></mujoco>)");
  Write("meshes/hand.stl", "mesh");
  Write("meshes/foot.stl", "of nobody");
  Write("skins/wood.png", "skin");
  EXPECT_THAT(Found(scene), ElementsAre("meshes/hand.stl", "robot.xml", "skins/wood.png"));
}

/// Of an include that was not called .xml the meshes were nobody's.
TEST_F(SceneFiles, WhatIsIncludedIsReadWhateverItIsCalled) {
  const auto scene = Write("scene.mjcf", R"(<mujoco><include file="robot.mjcf"/><include file="table"/></mujoco>)");
  Write("robot.mjcf", "\xEF\xBB\xBF\n<mujoco><mesh file='hand.stl'/></mujoco>");
  Write("table", R"(<mujoco><texture file="wood.bin"/></mujoco>)");
  Write("hand.stl", "mesh");
  Write("wood.bin", "no XML: file='foot.stl'");
  Write("foot.stl", "of nobody");
  EXPECT_THAT(Found(scene), ElementsAre("hand.stl", "robot.mjcf", "table", "wood.bin"));
}

/// MuJoCo looks for them by their names alone then, and they were in no hash.
TEST_F(SceneFiles, MeshesAreFoundWithoutTheirFoldersWhereTheSceneStripsPaths) {
  const std::string assets = R"(<mesh file="parts/hand.stl"/><mesh file="C:\parts\foot.stl"/></mujoco>)";
  Write("meshes/hand.stl", "mesh");
  Write("meshes/foot.stl", "mesh");
  EXPECT_THAT(Found(Write("a.xml", R"(<mujoco><compiler meshdir="meshes" strippath="true"/>)" + assets)),
              ElementsAre("meshes/foot.stl", "meshes/hand.stl"));
  EXPECT_THAT(Found(Write("b.xml", R"(<mujoco><compiler meshdir="meshes" strippath="false"/>)" + assets)),
              ElementsAre());
}

TEST_F(SceneFiles, FilesThatIncludeEachOtherAreReadOnce) {
  const auto scene = Write("a.xml", R"(<include file="b.xml"/>)");
  Write("b.xml", R"(<include file="a.xml"/>)");
  EXPECT_THAT(Found(scene), ElementsAre("b.xml"));
}

TEST_F(SceneFiles, WhatIsNoXmlNamesNothing) {
  for (const char* text : {"", "=", "file=", "file='a.xml", "='x'", "file==\"a.xml\"", "= = ="})
    EXPECT_THAT(Found(Write("odd.xml", text)), ElementsAre()) << text;
}

}  // namespace
}  // namespace evac
