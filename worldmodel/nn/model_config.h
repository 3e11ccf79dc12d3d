#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// Every size of the EVAC network. The defaults are the published model; small ones differ in numbers alone.
namespace evac::nn {

/// The denoiser (EVAC, Sec. 3; a latent video UNet after DynamiCrafter).
struct UNetConfig {
  std::int64_t in_channels = 19;  ///< 4 noisy latent, 4 image latent, 1 mask, 4 pose map latent, 3 ray direction, 3 ray
                                  ///< origin; with schedule.carry_plane_m 4 carried latent, 1 seen;
                                  ///< with carry_first 4 and 1 more; with object_forecast 1 more
  std::int64_t out_channels = 4;
  std::int64_t model_channels = 320;                            ///< a multiple of 32: the groups of every normalisation
  std::vector<std::int64_t> channel_mult = {1, 2, 4, 4};        ///< one per level, finest first
  std::int64_t num_res_blocks = 2;                              ///< per level
  std::vector<std::int64_t> attention_resolutions = {4, 2, 1};  ///< downsampling factors with transformers
  std::int64_t num_head_channels = 64;
  std::int64_t transformer_depth = 1;
  std::int64_t context_dim = 1024;
  std::int64_t init_attention_heads = 8;
  std::int64_t domains = 30;        ///< rows of the table of robots
  std::int64_t image_tokens = 256;  ///< per view, first in the context
  std::int64_t action_tokens = 16;  ///< after them
  /// Each frame's arms are added to its time embedding (frame_actions.h). Not in the paper.
  bool frame_actions = false;
  /// What the first picture of so many views shows about each hand is added too (hand_views.h). 0: none, as published.
  std::int64_t hand_views = 0;
};

/// The latent codec: AutoencoderKL of Stable Diffusion.
struct VaeConfig {
  std::int64_t image_channels = 3;
  std::int64_t channels = 128;
  std::vector<std::int64_t> channel_mult = {1, 2, 4, 4};
  std::int64_t num_res_blocks = 2;
  std::int64_t z_channels = 4;
  double scale_factor = 0.18215;  ///< latents are this times the posterior's sample
  /// Squares of so many pixels are one position of the first layer, their colours its channels: small codecs save the
  /// layers at full size. 1: as published.
  std::int64_t patch_px = 1;
  std::int64_t Stride() const { return patch_px << (channel_mult.size() - 1); }
};

/// A Perceiver resampler: any number of inputs to `queries` tokens.
struct ResamplerConfig {
  std::int64_t embedding_dim = 14;
  std::int64_t queries = 16;
  std::int64_t dim = 1024;
  std::int64_t depth = 4;
  std::int64_t dim_head = 64;
  std::int64_t heads = 12;
  std::int64_t output_dim = 1024;
  std::int64_t ff_mult = 4;
};

/// The visual tower of CLIP ViT-H/14.
struct ImageEncoderConfig {
  std::int64_t width = 1280;
  std::int64_t layers = 32;
  std::int64_t head_width = 80;
  std::int64_t patch_px = 14;
  std::int64_t image_px = 224;
  std::int64_t embed_dim = 1024;    ///< of keys that a checkpoint carries and nothing reads
  std::int64_t vocabulary = 49408;  ///< likewise
  std::int64_t text_length = 77;    ///< likewise
  std::int64_t Tokens() const { return image_px / patch_px * (image_px / patch_px) + 1; }
};

/// Diffusion noise (noise_schedule.h).
struct ScheduleConfig {
  std::int64_t steps = 1000;
  double linear_start = 0.00085;
  double linear_end = 0.012;
  bool zero_terminal_snr = true;
  bool dynamic_rescale = true;
  double base_scale = 0.7;
  std::int64_t turning_step = 400;
  /// The network's answer is counted from the v of "nothing changes": it need not learn to copy the newest memory
  /// frame. Not in the paper; helps where training is short.
  bool from_last_frame = false;
  /// With from_last_frame: where a camera moves, "nothing changes" is the newest memory frame carried to where the
  /// camera will be, as if all it shows lay in the plane z = this many metres of the base frame (carried_frame.h). The
  /// network is shown that too: z + 1 channels more. -10 … 10. Not in the paper.
  std::optional<double> carry_plane_m;
  /// How many memory frames are carried, 1 … ModelConfig::memory: what the newest does not show is looked for in the one
  /// before it, and so on. Of such places `seen` is one half.
  std::int64_t carry_frames = 1;
  /// With carry_frames above 1 and views: of an older frame, a place is carried only where no other view of the same scene
  /// whose camera stood still since saw its latents, or those next to them, change by more than this (root mean square
  /// over their z numbers): a thing that was taken is not shown where it was. 0: no view is asked. Not in the paper.
  double carry_unless_changed = 0;
  /// The oldest memory frame is carried too and shown beside: z + 1 channels more. In a rollout that is the first picture,
  /// which nobody imagined: what was seen then need not be passed on from one imagined picture to the next.
  bool carry_first = false;
  /// With from_last_frame: imagined latents nearer than this to "nothing changes" (root mean square over their z numbers,
  /// which the codec scales to a deviation of about 1) are taken for it, between once and twice as far in part: what each
  /// chunk changes by a little adds up, and what lies still would fade. 0: nothing is. Not in the paper.
  double unchanged_below = 0;
};

/// What a pose map draws with, pixels.
struct PoseMapSizes {
  int radius_px = 50;    ///< of the disc that shows the closure
  int thickness_px = 8;  ///< of the axes
};

/// How pose maps are drawn (EVAC, Sec. 3.2).
struct PoseMapConfig {
  bool scaled =
      false;  ///< radius and thickness in parts of the picture's height: 50 and 8 of 320. Published: in pixels
  /// Height in metres, base frame, to which a line is drawn straight down from each gripper: which point of the table
  /// it is above, which one camera alone does not show. -10 … 10. Not in the paper.
  std::optional<double> drop_line_m;
  /// From the recorded pose to where the fingers meet, along the tool axis: what the disc is drawn at. AgiBot records
  /// the flange; 0 for robots whose poses are the fingertips'. -5 … 5.
  double tool_length_m = 0.23;
  /// Arms that are told where to be follow late: a picture shows them where they were told to be this share of a frame
  /// before, 0 … 1. Maps and the cameras that move with a gripper are drawn so. Not in the paper, whose arms are
  /// measured.
  double lag_frames = 0;

  /// What is not as published, for files that were drawn so: " drop_line_m=0 tool_length_m=0", or nothing.
  std::string Differences() const;
  /// In a picture of this height: the published ones, or those in parts of it.
  PoseMapSizes Sizes(std::int64_t height_px) const;
  /// How maps of this height are drawn, for files that hold some: "radius_px=10 thickness_px=2", then the differences.
  std::string Words(std::int64_t height_px) const;
};

struct ModelConfig {
  UNetConfig unet;
  VaeConfig vae;
  /// 14 numbers per step → 16 tokens. As published they are a set: with an embedding_dim of 14 plus an even number, so
  /// many waves of the step's place are given with each.
  ResamplerConfig action_resampler;
  ResamplerConfig image_resampler{.embedding_dim = 1280, .queries = 256};  ///< CLIP's tokens → 256 tokens
  ImageEncoderConfig image_encoder;
  ScheduleConfig schedule;
  PoseMapConfig pose_map;
  std::int64_t chunk = 16;  ///< K: frames imagined at once
  std::int64_t memory = 4;  ///< N: frames remembered
  std::int64_t views = 1;   ///< V
  std::int64_t image_height_px = 320;
  std::int64_t image_width_px = 512;
  std::int64_t fps = 2;      ///< a constant of the released model
  std::int64_t domain = 11;  ///< AgiBot World's row in the table of robots
  /// A small network says where the thing will be, and the denoiser is shown that: one channel more, the last
  /// (object_forecast.h). Not in the paper.
  bool object_forecast = false;

  std::int64_t Frames() const { return memory + chunk; }
  std::int64_t LatentHeight() const { return image_height_px / vae.Stride(); }
  std::int64_t LatentWidth() const { return image_width_px / vae.Stride(); }

  /// @throws TensorError naming the size that no network can have, what was found and what is wanted.
  void Check() const;
};

}  // namespace evac::nn
