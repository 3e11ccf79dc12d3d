#pragma once

#include <mujoco/mujoco.h>

#include <cstddef>
#include <cstdint>

namespace evac::sim {

inline constexpr int kMaxGeoms = 400;               ///< shapes in one picture
inline constexpr int kMaxPicture_px = 2048 * 2048;  ///< of one picture as it is drawn, supersampling included

/// What a renderer and its drawing process share: memory of both, one order at a time (evac-draw, draw_server.h).
/// Both ends are always of one build: the layout is no file format.
struct DrawingBoard {
  // the order, written by the renderer
  int base = 0;  ///< which of the models sent so far, from 0
  int width_px = 0, height_px = 0;
  /// Shadows fall as in the picture before, of the same model and state: all shapes were there, here those in sight are.
  bool keeps_shadows = false;
  int geom_count = 0, light_count = 0;
  mjvGLCamera camera;
  mjvLight lights[mjMAXLIGHT];
  mjvGeom geoms[kMaxGeoms];
  // the answer, written by the drawing process
  char error[512];                          ///< of an answer that is kRefused, zero-terminated
  std::uint8_t rgb[3ULL * kMaxPicture_px];  ///< [height_px, width_px, 3], bottom row first
};

/// What is said over the socket beside the board, one byte each.
enum class DrawingWord : char {
  kLearn = 'l',    ///< renderer: the next base model lies in kModelFd
  kDraw = 'd',     ///< renderer: the board holds an order
  kDone = 'k',     ///< drawing process: learnt, or drawn
  kRefused = 'r',  ///< drawing process: not possible, the board says why
};

/// The drawing process's descriptors.
inline constexpr int kSocketFd = 3, kBoardFd = 4, kModelFd = 5;

}  // namespace evac::sim
