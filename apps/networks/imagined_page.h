#pragma once

#include <nlohmann/json.hpp>
#include <string>

/// What is read of an imagined.json (imagine_job.h writes it) before `evac imagine` goes on where it lies.
namespace evac {

/// The job that such a page tells of: an object.
/// @param where  names the file in messages
/// @throws InvalidInput if it tells of none, or lies more than 32 brackets deep
nlohmann::json JobOnPage(const std::string& text, const std::string& where);

/// "; seed is 9 there, 7 here; weights is another": what of `wanted` another job has otherwise, or not at all, in one
/// line; nothing where they are the same.
/// @param wanted, found  objects
std::string DifferencesOf(const nlohmann::json& wanted, const nlohmann::json& found);

}  // namespace evac
