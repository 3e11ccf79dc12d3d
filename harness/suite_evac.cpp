#include "harness/suite_evac.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>

#include "core/hash.h"

namespace evac {
namespace {

namespace fs = std::filesystem;

constexpr const char* kQuirks[] = {"memory_not_scaled", "residual_noise", "draw_behind_camera", "decoded_start"};

fs::path FileField(const Config& page, const std::string& key) {
  const fs::path path = page.Path(key);
  std::error_code ignored;
  page.Require(fs::is_regular_file(path, ignored), key, "a file that is there: " + path.string());
  return path;
}

void ReadSampler(const Config& page, SuiteEvac& evac) {
  evac.solver = page.Get<std::string>("solver", evac.solver);
  page.Require(evac.solver == "ddim" || evac.solver == "dpm", "solver", "ddim or dpm (DPM-Solver++)");
  evac.steps = page.Get<int>("steps", evac.steps);
  const int fewest = evac.solver == "dpm" ? 2 : 1;
  page.Require(evac.steps >= fewest && evac.steps <= 1000, "steps", fmt::format("{} … 1000", fewest));
  page.Require(!page.Has("eta") || evac.solver == "ddim", "eta", "none: DPM-Solver++ draws no noise");
  evac.eta = page.Get<double>("eta", evac.eta);
  page.Require(evac.eta >= 0 && evac.eta <= 1, "eta", "0 (deterministic) … 1");
  evac.cfg = page.Get<double>("cfg", evac.cfg);
  page.Require(evac.cfg >= 0 && evac.cfg <= 100, "cfg", "0 … 100; 1: no guidance");
  evac.cfg_rescale = page.Get<double>("cfg_rescale", evac.cfg_rescale);
  page.Require(evac.cfg_rescale >= 0 && evac.cfg_rescale <= 1, "cfg_rescale", "0 … 1");
}

void ReadQuirks(const Config& page, SuiteEvac& evac) {
  evac.quirks = page.Get<std::vector<std::string>>("quirks", {});
  for (const std::string& quirk : evac.quirks) {
    page.Require(quirk != "delta_window", "quirks", "none that reads actions a policy has not sent yet (delta_window)");
    page.Require(std::find(std::begin(kQuirks), std::end(kQuirks), quirk) != std::end(kQuirks), "quirks",
                 fmt::format("some of {}", fmt::join(kQuirks, ", ")));
  }
}

void ReadCache(const Config& page, SuiteEvac& evac) {
  if (!page.Has("cache")) return;
  const Config cache = page.Section("cache");
  cache.AllowOnly({"folder", "limit_gb"});
  evac.cache_folder = cache.Path("folder");
  evac.cache_limit_gb = cache.Get<double>("limit_gb", evac.cache_limit_gb);
  cache.Require(evac.cache_limit_gb > 0 && std::isfinite(evac.cache_limit_gb), "limit_gb", "more than 0");
}

std::string HashOf(const SuiteEvac& evac) {
  const std::string statistics = evac.statistics ? Config::FromFile(*evac.statistics).ContentHash() : "agibotworld";
  return Sha256Hex(fmt::format("{} {} {} {} {} {} {} {} {} {} {} {}{}", evac.weights_sha256,
                               Config::FromFile(evac.config).ContentHash(), statistics, evac.solver, evac.steps,
                               evac.eta, evac.cfg, evac.cfg_rescale, evac.period_s, evac.pose_map_scales,
                               evac.all_threads_per_scene, fmt::join(evac.quirks, ","), evac.bf16 ? " bf16" : ""));
}

}  // namespace

SuiteEvac ReadSuiteEvac(const Config& page) {
  SuiteEvac evac;
  evac.weights = FileField(page, "weights");
  evac.config = FileField(page, "config");
  if (page.Has("statistics")) evac.statistics = FileField(page, "statistics");
  ReadSampler(page, evac);
  evac.period_s = page.Get<double>("period_s", evac.period_s);
  page.Require(evac.period_s > 0 && evac.period_s <= 10, "period_s", "more than 0 … 10 s");
  const std::string pose_map = page.Get<std::string>("pose_map", "absolute");
  page.Require(pose_map == "absolute" || pose_map == "scaled", "pose_map", "absolute (pixels, as published) or scaled");
  evac.pose_map_scales = pose_map == "scaled";
  const std::string products = page.Get<std::string>("products", "float32");
  page.Require(products == "float32" || products == "bfloat16", "products", "float32 or bfloat16");
  evac.bf16 = products == "bfloat16";
  const std::string threads = page.Get<std::string>("threads_per_scene", "1");
  page.Require(threads == "1" || threads == "all", "threads_per_scene", "1 or all");
  evac.all_threads_per_scene = threads == "all";
  ReadQuirks(page, evac);
  ReadCache(page, evac);
  evac.weights_sha256 = Sha256HexOfFile(evac.weights);
  evac.hash = HashOf(evac);
  return evac;
}

void DemandUnchanged(const SuiteEvac& evac) {
  const auto demand = [](const std::string& file, const std::string& found, const std::string& wanted) {
    if (found == wanted) return;
    throw InvalidInput("{}: it is another file than when the suite was read: found SHA-256 {}, wanted {}", file, found,
                       wanted);
  };
  demand(evac.weights.string(), Sha256HexOfFile(evac.weights), evac.weights_sha256);
  const std::string statistics = evac.statistics ? " or " + evac.statistics->string() : "";
  demand(evac.config.string() + statistics, HashOf(evac), evac.hash);
}

bool IsHashedByContent(const std::string& line) {
  if (!line.starts_with(".worlds.")) return false;
  const std::size_t field = line.find('.', std::string(".worlds.").size());
  if (field == std::string::npos) return false;
  const std::string rest = line.substr(field);
  return rest.starts_with(".weights=") || rest.starts_with(".config=") || rest.starts_with(".statistics=") ||
         rest.starts_with(".profile=") || rest.starts_with(".cache.");
}

}  // namespace evac
