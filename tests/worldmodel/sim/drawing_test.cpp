#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <thread>

#include "core/error.h"
#include "tests/worldmodel/sim/sim_test_support.h"
#include "worldmodel/sim/renderer.h"

namespace evac::test {
namespace {

using namespace evac::sim;
using ::testing::HasSubstr;

/// A scene at its start, seen by the task's head camera.
struct View {
  explicit View(const std::string& id)
      : task(ReadTask(id)), model(LoadModel(ReadScenePage(task).scene)), data(MakeData(*model)) {
    mj_forward(model.get(), data.get());
  }
  cv::Mat Drawn(Renderer& renderer, int width_px = 96, int height_px = 64) {
    const Camera camera = Resized(task.cameras[0], width_px, height_px);
    return renderer.Draw(*model, *model, *data, camera, camera.mount_from_camera);
  }

  Task task;
  ModelPtr model;
  DataPtr data;
};

bool AreEqual(const cv::Mat& a, const cv::Mat& b) { return a.size() == b.size() && cv::norm(a, b, cv::NORM_INF) == 0; }

bool IsEmpty(const cv::Mat& image) {
  cv::Scalar mean, deviation;
  cv::meanStdDev(image, mean, deviation);
  return deviation[0] + deviation[1] + deviation[2] < 10;
}

TEST(Renderer, GoesOnWithAnotherProcessWhenTheFirstIsKilled) {
  Renderer renderer;
  View bottle("take_bottle"), toast("take_toast");
  const cv::Mat before = bottle.Drawn(renderer), other = toast.Drawn(renderer);
  EXPECT_FALSE(IsEmpty(before));
  EXPECT_FALSE(AreEqual(before, other));
  const pid_t first = renderer.DrawingPid();
  ASSERT_EQ(::kill(first, SIGKILL), 0);
  EXPECT_TRUE(AreEqual(toast.Drawn(renderer), other));
  EXPECT_TRUE(AreEqual(bottle.Drawn(renderer), before));
  EXPECT_NE(renderer.DrawingPid(), first);
}

TEST(Renderer, DrawsTheSameBesideOthers) {
  View alone("take_bottle");
  Renderer renderer;
  const cv::Mat expected = alone.Drawn(renderer);
  std::vector<std::thread> threads;
  std::atomic<int> same = 0;
  std::vector<View> views;  // made here: MuJoCo's compiler is for one thread at a time
  for (int i = 0; i < 3; ++i) views.emplace_back("take_bottle");
  for (std::size_t i = 0; i < 3; ++i) {
    threads.emplace_back([&, view = std::move(views[i])]() mutable {
      Renderer own;
      for (int k = 0; k < 10; ++k) same += AreEqual(view.Drawn(own), expected);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(same, 30);
}

TEST(Renderer, ItsProcessEndsWithIt) {
  pid_t pid = 0;
  {
    Renderer renderer;
    pid = renderer.DrawingPid();
    EXPECT_EQ(::kill(pid, 0), 0);
  }
  EXPECT_EQ(::kill(pid, 0), -1);
}

TEST(Renderer, RefusesAPictureThatIsTooLarge) {
  Camera camera = ReadTask("take_bottle").cameras[0];
  EXPECT_NO_THROW(RefuseUndrawable(Resized(camera, 768, 512)));
  try {
    RefuseUndrawable(Resized(camera, 3072, 2048));
    FAIL() << "no complaint";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("found 3072x2048 pixels, wanted at most 1048576 in all"));
  }
}

}  // namespace
}  // namespace evac::test
