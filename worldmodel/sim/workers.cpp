#include "worldmodel/sim/workers.h"

#include <system_error>

#include "core/error.h"

namespace evac::sim {

Workers::Workers(int threads) {
  try {
    for (int i = 0; i < threads; ++i) threads_.emplace_back([this] { Live(); });
  } catch (const std::system_error& error) {
    Stop();
    throw InternalError("cannot start {} threads to simulate in: {}", threads, error.what());
  }
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return ready_ == threads; });
  if (!start_error_) return;
  lock.unlock();
  Stop();
  std::rethrow_exception(start_error_);
}

Workers::~Workers() { Stop(); }

void Workers::Stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  for (std::thread& thread : threads_) thread.join();
  threads_.clear();
}

void Workers::Run(int count, const Work& work) {
  std::unique_lock lock(mutex_);
  work_ = &work;
  next_ = 0;
  errors_.assign(static_cast<std::size_t>(count), nullptr);
  unfinished_ = count;
  changed_.notify_all();
  changed_.wait(lock, [&] { return unfinished_ == 0; });
  work_ = nullptr;
  for (const std::exception_ptr& error : errors_) {
    if (error) std::rethrow_exception(error);
  }
}

void Workers::Live() {
  std::unique_ptr<Renderer> renderer;
  std::exception_ptr error;
  try {
    renderer = std::make_unique<Renderer>();
  } catch (...) {
    error = std::current_exception();
  }
  std::unique_lock lock(mutex_);
  if (error) start_error_ = error;
  ++ready_;
  changed_.notify_all();
  if (!renderer) return;
  while (true) {
    changed_.wait(lock, [&] { return stopping_ || (work_ && next_ < static_cast<int>(errors_.size())); });
    if (stopping_) return;
    const int item = next_++;
    const Work& work = *work_;
    lock.unlock();
    const std::exception_ptr failure = Do(work, item, *renderer);
    lock.lock();
    errors_[static_cast<std::size_t>(item)] = failure;
    if (--unfinished_ == 0) changed_.notify_all();
  }
}

std::exception_ptr Workers::Do(const Work& work, int item, Renderer& renderer) {
  try {
    work(item, renderer);
    return nullptr;
  } catch (...) {
    return std::current_exception();
  }
}

}  // namespace evac::sim
