// SPDX-License-Identifier: GPL-3.0-or-later
#include "support/thread_pool.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <utility>

#if defined(__x86_64__) || defined(_M_X64)
#include <immintrin.h>
#endif

namespace dd {

namespace {

constexpr int kMostThreads = 8;
constexpr auto kAwake = std::chrono::microseconds(200);  // before a helper goes to sleep

void pause() {
#if defined(__x86_64__) || defined(_M_X64)
  _mm_pause();
#else
  std::this_thread::yield();
#endif
}

}  // namespace

ThreadPool::ThreadPool(int count) {
  if (count <= 0)
    count = std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, kMostThreads);
  helpers_.reserve(static_cast<size_t>(count - 1));
  try {
    while (this->count() < count) helpers_.emplace_back([this] { help(); });
  } catch (const std::exception&) {
    // No result depends on their number: those that did start do the work.
  }
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    leave_ = true;
    ++round_;
  }
  wake_.notify_all();
  for (std::thread& helper : helpers_) helper.join();
}

void ThreadPool::share(Call call, const void* task, int task_count) {
  call_ = call;
  task_ = task;
  task_count_ = task_count;
  next_ = 0;
  open_ = true;
  bool sleepers;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++round_;
    sleepers = asleep_ > 0;
  }
  if (sleepers) wake_.notify_all();
  work();
  // A helper that comes late finds the round closed: nobody waits for one to wake up.
  open_ = false;
  while (inside_ > 0) pause();
  const std::exception_ptr failure = std::exchange(failure_, nullptr);
  taken_ = false;
  if (failure) std::rethrow_exception(failure);
}

void ThreadPool::work() {
  try {
    for (int i; (i = next_.fetch_add(1)) < task_count_;) call_(task_, i);
  } catch (...) {
    next_ = task_count_;
    const std::lock_guard<std::mutex> lock(mutex_);
    if (!failure_) failure_ = std::current_exception();
  }
}

void ThreadPool::help() {
  for (unsigned seen = 0;;) {
    const auto until = std::chrono::steady_clock::now() + kAwake;
    while (round_ == seen) {
      for (int i = 0; i < 64 && round_ == seen; ++i) pause();
      if (std::chrono::steady_clock::now() < until) continue;
      std::unique_lock<std::mutex> lock(mutex_);
      ++asleep_;
      wake_.wait(lock, [&] { return round_ != seen; });
      --asleep_;
    }
    seen = round_;
    if (leave_) return;
    ++inside_;
    if (open_) work();
    --inside_;
  }
}

}  // namespace dd
