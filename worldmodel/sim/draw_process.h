#pragma once

#include <mujoco/mujoco.h>
#include <sys/types.h>

#include <optional>
#include <string>

#include "worldmodel/sim/drawing_board.h"

namespace evac::sim {

/// One running `evac-draw`, started beside this program, and the memory shared with it. It ends with this object, and
/// with this process however that ends. Not for use by two threads at once.
class DrawProcess {
 public:
  /// @throws InternalError if evac-draw is not there, does not start, or finds no OpenGL (in its own words).
  DrawProcess();
  ~DrawProcess();
  DrawProcess(const DrawProcess&) = delete;
  DrawProcess& operator=(const DrawProcess&) = delete;

  DrawingBoard& board() { return *board_; }
  pid_t pid() const { return pid_; }  ///< -1 once it was found dead

  /// Sends a model that orders may name from now on: the first is base 0.
  /// @returns how the process died, nothing if it did not. @throws InternalError if the process refuses.
  [[nodiscard]] std::optional<std::string> Learn(const mjModel& base);
  /// Has the board's order drawn; then board().rgb holds the picture. Returns and throws like Learn.
  [[nodiscard]] std::optional<std::string> Draw();

 private:
  std::optional<std::string> Ask(DrawingWord word);
  std::optional<std::string> HearAnswer();
  std::string HowItDied();
  void Start();
  void End();

  int socket_fd_ = -1, model_fd_ = -1, board_fd_ = -1;
  pid_t pid_ = -1;
  DrawingBoard* board_ = nullptr;
};

}  // namespace evac::sim
