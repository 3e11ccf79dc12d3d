#pragma once

#include <functional>
#include <string>

namespace evac {

/// Does `work` in a process of its own, a fork of this one, and returns what it returned: for libraries that crash on a
/// hostile file where they should refuse it. The child has its own memory: nothing else that `work` changes is seen
/// here.
/// @param what  begins the message, "FILE"
/// @throws the Error that `work` threw; InvalidInput if it threw something else, crashed or computed for more than a
///   minute; InternalError if there can be no process, or it was stopped from outside
std::string InChild(const std::string& what, const std::function<std::string()>& work);

}  // namespace evac
