#include "judges/rating_limits.h"

#include <algorithm>

namespace evac {

double RateLimiter::LeftIn(const Bucket& bucket, std::int64_t now_ms) const {
  const double passed_s = 1e-3 * static_cast<double>(std::max<std::int64_t>(0, now_ms - bucket.at_ms));
  return std::min(options_.burst, bucket.left + passed_s * options_.per_s);
}

bool RateLimiter::WouldAllow(const std::string& name, std::int64_t now_ms) const {
  const auto found = buckets_.find(name);
  return found == buckets_.end() || LeftIn(found->second, now_ms) >= 1;
}

bool RateLimiter::Allow(const std::string& name, std::int64_t now_ms) {
  if (buckets_.size() >= options_.names &&
      !buckets_.contains(name)) {  // whoever has waited long enough is as good as new
    std::erase_if(buckets_, [&](const auto& entry) { return LeftIn(entry.second, now_ms) >= options_.burst; });
    if (buckets_.size() >= options_.names) return false;
  }
  Bucket& bucket = buckets_.try_emplace(name, Bucket{options_.burst, now_ms}).first->second;
  bucket = {LeftIn(bucket, now_ms), now_ms};
  if (bucket.left < 1) return false;
  bucket.left -= 1;
  return true;
}

}  // namespace evac
