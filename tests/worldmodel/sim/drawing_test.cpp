#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <atomic>
#include <thread>

#include "core/error.h"
#include "tests/worldmodel/sim/sim_test_support.h"
#include "worldmodel/sim/draw_process.h"
#include "worldmodel/sim/renderer.h"

namespace evac::test {
namespace {

using namespace evac::sim;
using ::testing::HasSubstr;
using ::testing::Optional;

/// A scene at its start, seen by the task's head camera.
struct View {
  explicit View(const std::string& id)
      : task(ReadTask(id)), model(LoadModel(ReadScenePage(task).scene)), data(MakeData(*model)) {
    mj_forward(model.get(), data.get());
  }
  cv::Mat Drawn(Renderer& renderer, int width_px = 96, int height_px = 64) {
    const Camera camera = Resized(task.cameras[0], width_px, height_px);
    return renderer.Draw(*model, *model, *data, {{camera, camera.mount_from_camera}}).at(0);
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

TEST(Renderer, DrawsAgainAfterNoOtherProcessCouldBeStarted) {
  Renderer renderer;
  View bottle("take_bottle");
  const cv::Mat before = bottle.Drawn(renderer);
  rlimit descriptors{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &descriptors), 0);
  const rlimit none_left{1, descriptors.rlim_max};
  ASSERT_EQ(::kill(renderer.DrawingPid(), SIGKILL), 0);
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none_left), 0);
  EXPECT_THROW(bottle.Drawn(renderer), Error);
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &descriptors), 0);
  EXPECT_TRUE(AreEqual(bottle.Drawn(renderer), before));
}

TEST(DrawProcess, AskedAfterItsEndItSaysSoAndSignalsNobody) {
  DrawProcess process;
  ASSERT_EQ(::kill(process.pid(), SIGKILL), 0);
  EXPECT_THAT(process.Draw(), Optional(HasSubstr("was ended by signal 9")));
  ASSERT_EQ(process.pid(), -1);
  EXPECT_THAT(process.Draw(), Optional(HasSubstr("had ended before")));
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

/// A camera at `place` that looks straight down.
Eigen::Isometry3d Above(const Eigen::Vector3d& place) {
  Eigen::Isometry3d base_from_camera = Eigen::Isometry3d::Identity();
  base_from_camera.linear() = Eigen::Vector3d(1, -1, -1).asDiagonal();
  base_from_camera.translation() = place;
  return base_from_camera;
}

TEST(Renderer, PicturesDrawnTogetherAreThoseDrawnAlone) {
  Renderer together, alone;
  for (const char* id : {"take_bottle", "take_toast", "take_ham", "take_lettuce"}) {
    View view(id);
    const Camera head = Resized(view.task.cameras[0], 96, 64), small = Resized(view.task.cameras[1], 48, 32);
    std::vector<SceneView> views = {{head, head.mount_from_camera}};
    for (const double x : {0.1, 0.45, 0.7}) {
      for (const double y : {-0.3, 0.0, 0.2}) {
        views.push_back({head, Above({x, y, 0.25})});
        views.push_back({small, Above({x, y, 0.5})});
      }
    }
    const std::vector<cv::Mat> pictures = together.Draw(*view.model, *view.model, *view.data, views);
    ASSERT_EQ(pictures.size(), views.size());
    for (std::size_t i = 0; i < views.size(); ++i) {
      const cv::Mat expected = alone.Draw(*view.model, *view.model, *view.data, {views[i]}).at(0);
      EXPECT_TRUE(AreEqual(pictures[i], expected)) << id << ", view " << i;
      EXPECT_TRUE(i == 0 || !AreEqual(pictures[i], pictures[i - 1])) << id << ", view " << i;
    }
  }
}

TEST(Renderer, ShadowsOfWhatIsOutOfSightAreInSight) {
  View view("take_bottle");
  Renderer renderer;
  const Camera camera = Resized(view.task.cameras[1], 96, 64);
  const std::vector<SceneView> views = {{camera, Above({0.45, 0, 0.5})}, {camera, Above({0.0, 0.25, 0.12})}};
  const cv::Mat with = renderer.Draw(*view.model, *view.model, *view.data, views).at(1);
  std::fill_n(view.model->light_castshadow, view.model->nlight, mjtByte{0});
  const cv::Mat without = renderer.Draw(*view.model, *view.model, *view.data, views).at(1);
  EXPECT_FALSE(AreEqual(with, without)) << "beside the arm, away from the light";
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
