#pragma once

#include <filesystem>
#include <string>

#include "core/error.h"
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
/// What makes its questions quick; a study of an earlier evac gets them when it is next opened for writing.
extern const char* const kStudyIndexes;

/// @param field  what in the study's file, with what was found
Error DamagedStudy(const std::filesystem::path& folder, const std::string& field, const char* wanted);

}  // namespace evac
