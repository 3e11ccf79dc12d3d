#pragma once

#include <string>

namespace evac::train {

/// What two trainings' identities (Trainer::Identity, with what TrainerOptions::identity holds) do not say alike, by
/// the names that the user has for it: "learning_rate is 0.002 there, 0.001 here; --threads is 1 there, 2 here". What
/// only one says is "none" in the other.
std::string WhatDiffers(const std::string& there, const std::string& here);

}  // namespace evac::train
