#pragma once

#include <filesystem>
#include <span>

#include "core/store_sqlite.h"

namespace evac::schema {

/// SQL that leads from one version to the next: Steps()[n] makes version n + 1 of version n. Append, never change.
std::span<const char* const> Steps();

/// Brings a database to the last version of `steps`, each step in a transaction of its own with its number.
/// @param file  for the message.
/// @throws InvalidInput if the database is newer than `steps`, or another program's.
void Migrate(sqlite::Connection& connection, std::span<const char* const> steps, const std::filesystem::path& file);

/// The version a database has: 0 if it is empty. @throws InvalidInput if it is newer than `steps`, or another
/// program's.
int Version(sqlite::Connection& connection, std::span<const char* const> steps, const std::filesystem::path& file);

}  // namespace evac::schema
