#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "worldmodel/sim/renderer.h"

namespace evac::sim {

/// A few threads, each with a renderer of its own, that share out numbered items.
class Workers {
 public:
  using Work = std::function<void(int item, Renderer& renderer)>;

  /// @throws Error of a thread that gets no renderer, or that cannot be started.
  explicit Workers(int threads);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  /// Calls `work` once for each item 0 … count - 1, in any order, at the same time on several threads; returns when all
  /// are done. What `work` throws is thrown again here, the lowest item's first.
  void Run(int count, const Work& work);

 private:
  void Live();
  void Stop();
  static std::exception_ptr Do(const Work& work, int item, Renderer& renderer);

  std::mutex mutex_;  ///< guards all below but threads_
  std::condition_variable changed_;
  const Work* work_ = nullptr;
  int next_ = 0, unfinished_ = 0, ready_ = 0;
  bool stopping_ = false;
  std::vector<std::exception_ptr> errors_;  ///< per item
  std::exception_ptr start_error_;
  std::vector<std::thread> threads_;
};

}  // namespace evac::sim
