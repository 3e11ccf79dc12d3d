#pragma once

/// A recipe of `evac collect` with one of every field, and the pages that it names, for fuzzing. They lie in one
/// folder; none names a file outside of it.
struct RecipePage {
  char letter;  ///< says which it is, before its bytes
  const char* file;
  const char* text;
};

inline constexpr RecipePage kRecipePages[] = {
    {'r', "recipe.yaml", R"(recipe: small
profile: profile.yaml
tasks:
  - {page: task.yaml, object: bottle, middle_m: [0, 0, 0.09]}
episodes: 10
episodes_per_state: 3
chunk_size: 8
max_chunks: 12
still: {translation_m: 0.005, rotation_rad: 0.05, closure: 0.05, dwell_chunks: 1}
image: {height_px: 64, width_px: 96}
video: {crf: 10, scale: 2}
mix:
  - {name: good, share: 12, policy: visual_pick, noise_m: [0, 0.008], speed: [0.9, 1.1], sway_m: [0, 0.01]}
  - {name: empty, share: 4.5, policy: visual_pick, miss_m: [0.02, 0.08], miss_deg: [0, 360], retries: [0, 0.7]}
  - {name: away, share: 2, policy: visual_pick, turn_deg: [-35, 35], without_object: true, unaware: true}
  - {name: push, share: 4, policy: explorer, does: push, speed: [0.5, 1.0]}
  - {name: on_policy, share: 1, policy: learned, checkpoint: scene.xml}
)"},
    {'t', "task.yaml", R"(id: take_bottle
instruction: Take the bottle.
arms: [right]
period_s: 0.1
max_chunks: 20
workspace_m: {min: [0.1, -0.45, 0], max: [0.8, 0.45, 0.6]}
cameras:
  - {name: head, mount: base, width_px: 96, height_px: 64, fovy_deg: 40, position_m: [1, 0, 1], look_at_m: [0, 0, 0],
     up: [0, 0, 1]}
rubric:
  version: "1"
  success: It was taken.
  stages:
    - {name: reach, description: It was reached., all_of: [{kind: distance, a: gripper, b: bottle, below: 0.2}]}
mujoco:
  scene: scene.xml
  includes: []
  home: {position_m: [0.3, 0, 0.3], quat_xyzw: [1, 0, 0, 0]}
  objects:
    - {body: box, x_m: [0.38, 0.5], y_m: [-0.18, -0.06], z_m: 0, yaw_deg: [-25, 25]}
    - {body: bottle, inside: box, x_m: [0, 0], y_m: [0, 0], z_m: 0.0042, yaw_deg: [-180, 180]}
  colours:
    - {materials: [bottle], hue_deg: [-14, 14], saturation: [0.9, 1], value: [0.9, 1.1]}
  light: {strength: [0.9, 1.1], azimuth_deg: [-35, 35], warmth: [0, 0.05]}
  clutter: {bodies: [mug], chance: 0.75, places_m: [[0.2, 0.4]], spread_m: 0.03}
)"},
    {'p', "profile.yaml", R"(name: real
physics: {pad_friction: 0.75, object_friction: 0.85, mass: 1.2}
actuators: {gain: 0.9, lag_s: 0.03, grip_force_n: 18, grip_speed: 2.2}
calibration: {seed: 1, camera_position_m: 0.003, camera_rotation_deg: 0.35, joint_offset_deg: 0.12}
sensors: {image_noise: 2.5, arm_position_m: 0.0004, arm_rotation_deg: 0.1, closure: 0.004}
light: {strength: 0.94, ambient: 0.95, warmth: 0.04, shadows: true}
)"}};

/// What the task is done in: the pages' bodies are looked for in it by the world alone.
inline constexpr const char* kRecipeScene = "<mujoco><worldbody></worldbody></mujoco>";
