#pragma once

#include <filesystem>

#include "core/store_sqlite.h"
#include "core/store_study.h"

/// Shared by core/store_study*.cpp alone.
namespace evac {

struct StudyStore::Database {
  std::filesystem::path folder;
  mutable sqlite::Connection connection;
};

/// Tables, triggers and views of a study of schema 1.
extern const char* const kStudySchema;

}  // namespace evac
