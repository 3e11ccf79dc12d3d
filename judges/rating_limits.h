#pragma once

#include <cstdint>
#include <string>
#include <unordered_map>

namespace evac {

/// So many at once and so many a second, per name; a name that was quiet for long is forgotten. One thread.
class RateLimiter {
 public:
  struct Options {
    double burst = 60, per_s = 20;
    std::size_t names = 10'000;  ///< remembered at once; above that a new one is let in when another has been quiet
  };
  explicit RateLimiter(Options options) : options_(options) {}

  /// @param now_ms  never goes back. @returns whether one more is let through.
  bool Allow(const std::string& name, std::int64_t now_ms);
  /// Whether one more would be.
  bool WouldAllow(const std::string& name, std::int64_t now_ms) const;

 private:
  struct Bucket {
    double left = 0;
    std::int64_t at_ms = 0;
  };
  double LeftIn(const Bucket& bucket, std::int64_t now_ms) const;

  Options options_;
  std::unordered_map<std::string, Bucket> buckets_;
};

}  // namespace evac
