#pragma once

namespace evac::sim {

/// The whole life of a drawing process (`evac-draw`): opens OpenGL, then answers the orders that come over kSocketFd
/// until that is closed, which is when the renderer that started it is gone, however it went.
///
/// OpenGL lives in processes of its own because Mesa's software rasteriser keeps one screen per process, and two
/// contexts that draw at the same time crash inside it now and then (Mesa 22.3); and because a crash of a graphics
/// driver should cost one picture, not the run (docs/decisions/0023-drawing-processes.md).
/// @returns the process's exit code.
int ServeDrawings();

}  // namespace evac::sim
