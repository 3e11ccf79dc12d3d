#include "policies/visual_options.h"

#include <fmt/format.h>

#include <cmath>

#include "core/error.h"

namespace evac {
namespace {

void Require(const char* option, double found, double low, double high) {
  if (std::isfinite(found) && found >= low && found <= high) return;
  throw InvalidInput("visual_pick: {} is {}, wanted a number from {} to {}", option, found, low, high);
}

}  // namespace

void Check(const VisualPickOptions& options) {
  Require("chunk-size", options.chunk_size, 1, 1000);
  Require("bias-m (x)", options.bias_m.x(), -0.5, 0.5);
  Require("bias-m (y)", options.bias_m.y(), -0.5, 0.5);
  Require("noise-m", options.noise_m, 0, 0.5);
  Require("request-noise-m", options.request_noise_m, 0, 0.5);
  Require("place-noise-m", options.place_noise_m, 0, 0.5);
  Require("high-m", options.high_m, -0.03, 0.06);
  Require("turn-deg", options.turn_deg, -90, 90);
  Require("hurry", options.hurry, 0, 1);
  Require("late-close-s", options.late_close_s, -0.5, 3);
  Require("early-release-s", options.early_release_s, 0, 3);
  Require("blindness", options.blindness, 0, 1);
  Require("request-blindness", options.request_blindness, 0, 1);
  Require("speed", options.speed, 0.1, 1.5);
  Require("retries", options.retries, 0, 5);
}

}  // namespace evac
