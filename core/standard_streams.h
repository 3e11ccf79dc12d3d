#pragma once

namespace evac {

/// Opens /dev/null as whichever of standard input, output and error is closed, so that no file gets its number, and what
/// is printed ends up in none. As output it cannot be written to: results that nobody can read are an error still.
/// Before anything else of a program.
void OpenStandardStreams();

}  // namespace evac
