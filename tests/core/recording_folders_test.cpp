#include "core/recording_folders.h"

#include <gmock/gmock.h>

#include "core/error.h"
#include "core/npy.h"
#include "core/recording.h"
#include "tests/support/synthetic_recording.h"
#include "tests/support/temp_folder.h"

namespace evac {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// A folder of clips as a lab has it: one whole, one whose recorder died before the arms were written, one with a
/// picture alone, a day's below a folder of their own, and things that are no recordings.
class FolderOfClips : public testing::Test {
 protected:
  FolderOfClips() {
    for (const char* name : {"good", "dead", "day2/0001"}) SyntheticClip(4).Write(OneFolder(mine_ / name));
    fs::remove(mine_ / "dead/proprio_stats.h5");
    WriteText(mine_ / "still/frame.png", "no picture");
    WriteText(mine_ / "notes/todo.txt", "");
    WriteText(mine_ / ".git/HEAD", "");
  }

  const TempFolder folder_;
  const fs::path mine_ = fs::canonical(folder_.path()) / "mine";
};

/// It was no recording at all: in no shard, no initial state and no count of what was left out.
TEST_F(FolderOfClips, OneWithoutTheArmsTrackIsFoundAndRefusedAsABrokenOne) {
  const auto found = [&] { return FindRecordings(mine_); };
  EXPECT_THAT(found(), ElementsAre(mine_ / "dead", mine_ / "good", mine_ / "still"));
  EXPECT_THAT(FindRecordings(mine_ / "dead"), ElementsAre(mine_ / "dead"));
  for (const auto& [name, picture] : {std::pair("dead", "head_color.mp4"), std::pair("still", "frame.png")}) {
    try {
      ReadRecording(mine_ / name);
      ADD_FAILURE() << name << " was read";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kInvalidInput);
      EXPECT_STREQ(error.kind(), "broken_track");
      EXPECT_THAT(error.what(),
                  AllOf(HasSubstr(name), HasSubstr(picture), HasSubstr("neither action.npy nor proprio_stats.h5")));
    }
  }
  WriteText(mine_ / "frame.png", "a preview of them all");
  EXPECT_THAT(found(), ElementsAre(mine_ / "dead", mine_ / "good", mine_ / "still")) << "it is of several still";
}

TEST_F(FolderOfClips, SubfoldersThatHoldNoneAreToldApart) {
  EXPECT_THAT(PassedOver(mine_), ElementsAre(mine_ / "day2", mine_ / "notes"));
  EXPECT_THAT(PassedOver(mine_ / "good"), IsEmpty());
  EXPECT_THAT(PassedOver(mine_ / "day2"), IsEmpty());
  SyntheticClip(4).Write(TreeUnder(mine_ / "tree"));
  EXPECT_THAT(PassedOver(mine_ / "tree"), IsEmpty()) << "what lies beside observations belongs to it";
  EXPECT_THAT(PassedOver(mine_ / "tree/observations/327"), IsEmpty());
}

/// Who wants the head alone asked all cameras to be whole before it knew their names.
TEST(CamerasIn, AreKnownByTheirFilesWithoutReadingAny) {
  const TempFolder folder;
  SyntheticClip clip(4);
  clip.cameras = {"head", "hand_left", "hand_right"};
  clip.Write(OneFolder(folder / "clip"));
  clip.Write(TreeUnder(folder / "tree"));
  const fs::path episode = folder.path() / "tree/observations/327/648642";
  for (const fs::path& one : {folder / "clip", episode, episode / "videos"})
    EXPECT_THAT(CamerasIn(one), ElementsAre("head", "hand_left", "hand_right"));

  WriteText(folder / "clip/hand_right_color.mp4", "no video");
  fs::remove(folder / "clip/hand_left_color.mp4");
  EXPECT_THAT(CamerasIn(folder / "clip"), ElementsAre("head", "hand_left", "hand_right")) << "its page is there";
  EXPECT_THROW(ReadRecording(folder / "clip"), Error);
  EXPECT_EQ(ReadRecording(folder / "clip", {.cameras = {"head"}}).cameras.size(), 1u);
  fs::remove(folder / "clip/hand_left_intrinsic_params.json");
  EXPECT_THAT(CamerasIn(folder / "clip"), ElementsAre("head", "hand_right"));
  WriteNpy(folder / "clip/action.npy", {"<f8", {1, 16}, std::vector<double>(16, 0)});
  EXPECT_THAT(CamerasIn(folder / "clip"), ElementsAre("head")) << "it is read as an example";
}

}  // namespace
}  // namespace evac
