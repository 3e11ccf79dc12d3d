#include "judges/rating_worker.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "core/error.h"

namespace evac {
namespace {

HttpAnswer Trouble(int status, const char* error) {
  return {status, "application/json", std::string("{\"error\":\"") + error + "\"}"};
}

}  // namespace

RatingWorker::RatingWorker(StudyStore store, bool writes)
    : store_(std::move(store)), writes_(writes), thread_([this] { Run(); }) {}

RatingWorker::~RatingWorker() { Stop(); }

void RatingWorker::Push(Work work, RatingHttp::Reply reply) {
  {
    const std::lock_guard lock(mutex_);
    if (stopped_) return;
    waiting_.push_back({std::move(work), std::move(reply)});
  }
  is_work_.notify_one();
}

void RatingWorker::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
  }
  is_work_.notify_one();
  if (thread_.joinable()) thread_.join();
  const std::lock_guard lock(mutex_);
  waiting_.clear();
}

void RatingWorker::Run() {
  for (;;) {
    std::vector<Job> jobs;
    {
      std::unique_lock lock(mutex_);
      is_work_.wait(lock, [this] { return stopped_ || !waiting_.empty(); });
      if (stopped_) return;
      jobs.swap(waiting_);
    }
    DoTogether(jobs);
  }
}

void RatingWorker::DoTogether(std::vector<Job>& jobs) {
  std::vector<HttpAnswer> answers;
  try {
    if (writes_) store_.Begin();
    for (const Job& job : jobs) answers.push_back(DoOne(job));
    if (writes_) store_.Commit();
  } catch (const std::exception& error) {  // the disk is full, the lock was not to be had: nothing of this was kept
    spdlog::error("rating: {}", error.what());
    try {
      store_.Rollback();
    } catch (const std::exception&) {  // SQLite did so itself
    }
    answers.assign(jobs.size(), Trouble(503, "store"));
  }
  for (std::size_t i = 0; i < jobs.size(); ++i) jobs[i].reply(std::move(answers[i]));
}

HttpAnswer RatingWorker::DoOne(const Job& job) {
  if (writes_) store_.Mark();
  try {
    HttpAnswer answer = job.work(store_);
    if (writes_) store_.Release();
    return answer;
  } catch (const std::exception& error) {
    spdlog::error("rating: {}", error.what());
    if (writes_) store_.Undo();
    return Trouble(500, "internal");
  }
}

}  // namespace evac
