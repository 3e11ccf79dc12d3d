#pragma once

#include <string>
#include <vector>

#include "core/config.h"
#include "worldmodel/train/settings.h"

namespace evac {

/// Reads one section ("codec", "forecast", "world", "judge", "policy") of a page of training options into them; what is not there stays as the paper
/// has it. Then `assignments` ("batch=16").
/// @param path  empty: no page
/// @throws InvalidInput naming file and field: unknown, of a wrong type, a text that is not in one line
void ReadTrainingPage(const std::string& path, const std::string& section, const std::vector<std::string>& assignments,
                      const train::Settings& settings);

/// "training.yaml:7: field world.drop: ": where ReadTrainingPage, told the same, found an option; empty: nowhere.
std::string WhereGiven(const std::string& path, const std::string& section, const std::vector<std::string>& assignments,
                       const std::string& option);

}  // namespace evac
