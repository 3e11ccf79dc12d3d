#pragma once

#include <string>
#include <vector>

/// Names with commas between them, as metadata of tensor files hold them.
namespace evac {

/// "head,hand_right": two names; "": none.
std::vector<std::string> NamesIn(const std::string& joined);
std::string Joined(const std::vector<std::string>& names);

}  // namespace evac
