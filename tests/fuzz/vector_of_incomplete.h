#pragma once

// libtorch 1.13 names vectors of a class that is whole only later. GCC bears that; Clang wants the members of a vector
// at once, where they are constexpr. So here they are not: included before everything else (CMakeLists.txt).
#include <string>

#undef _GLIBCXX20_CONSTEXPR
#define _GLIBCXX20_CONSTEXPR
#define __fill_a1 fill_a1_of_bits  // <string> declared it constexpr; std::fill of vector<bool> does not link
#include <vector>
#undef __fill_a1
#undef _GLIBCXX20_CONSTEXPR
#define _GLIBCXX20_CONSTEXPR constexpr
