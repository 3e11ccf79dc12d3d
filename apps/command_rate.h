#pragma once

#include "apps/commands.h"

namespace evac {

/// `evac rate`: new, invite, serve, status, export, import, resolve (docs/rating_session.md).
void AddRate(CLI::App& app, ExitCode& exit_code);

}  // namespace evac
