#pragma once

#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <vector>

#include "core/store_study.h"
#include "judges/rating_http.h"

namespace evac {

/// One thread that owns a study's store. What waits is done together and made durable by one wait for the disk; only
/// then are the answers given (group commit): whoever hears 200 has it on disk, and many share the price.
class RatingWorker {
 public:
  /// Works on the store; what it throws undoes its own changes alone and is answered 500.
  using Work = std::function<HttpAnswer(StudyStore&)>;

  RatingWorker(StudyStore store, bool writes);
  ~RatingWorker();

  void Push(Work work, RatingHttp::Reply reply);
  /// Answers nobody any more.
  void Stop();

 private:
  struct Job {
    Work work;
    RatingHttp::Reply reply;
  };
  void Run();
  void DoTogether(std::vector<Job>& jobs);
  HttpAnswer DoOne(const Job& job);

  StudyStore store_;
  bool writes_;
  std::mutex mutex_;
  std::condition_variable is_work_;
  std::vector<Job> waiting_;
  bool stopped_ = false;
  std::thread thread_;
};

}  // namespace evac
