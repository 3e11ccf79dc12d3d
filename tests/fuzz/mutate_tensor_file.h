#pragma once

#include <string>

/// Changes one thing of a safetensors file, so that it stays one: a size (alone, or everywhere), a type, numbers or a
/// metadata's value. Bytes alone seldom do, as the header says where everything lies.
/// @returns nothing if it is none, or would be longer than `max_size`
std::string MutatedTensorFile(const std::string& bytes, unsigned seed, std::size_t max_size);
