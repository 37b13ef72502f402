// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace dd {

constexpr int kLeastRange = 512;  ///< rows, triangles and the like that are worth a task

/// A few threads that share out the tasks of one caller at a time; who comes meanwhile, from
/// another thread or from within a task, works alone. Between the parts of a frame, which are some
/// tens of microseconds apart, they wait awake; else they sleep.
class ThreadPool {
 public:
  /// count: threads at work, the caller among them; 0: as many as the machine has, at most 8. Where
  /// the system starts no more threads there are fewer.
  explicit ThreadPool(int count = 0);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int count() const { return static_cast<int>(helpers_.size()) + 1; }

  /// Calls task(0) to task(task_count − 1), each once, in any order and from any of the threads;
  /// returns when all are done. Rethrows the first exception.
  template <class Task>
  void run(int task_count, const Task& task) {
    if (task_count <= 1 || helpers_.empty() || taken_.exchange(true)) {
      for (int i = 0; i < task_count; ++i) task(i);
      return;
    }
    share([](const void* of, int i) { (*static_cast<const Task*>(of))(i); }, &task, task_count);
  }

  /// Splits 0 to count into even ranges of at least least and calls body(begin, end) for each.
  template <class Body>
  void parallel_for(int64_t item_count, int64_t least, const Body& body) {
    if (item_count == 0) return;
    const int64_t ranges = std::max<int64_t>(1, std::min<int64_t>(4 * count(), item_count / least));
    run(static_cast<int>(ranges),
        [&](int i) { body(item_count * i / ranges, item_count * (i + 1) / ranges); });
  }

 private:
  using Call = void (*)(const void* task, int index);
  /// By who has taken the helpers, whom it lets go.
  void share(Call call, const void* task, int task_count);
  void help();
  void work();

  std::vector<std::thread> helpers_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::atomic<unsigned> round_{0};  ///< grows with each share()
  std::atomic<bool> leave_{false};
  std::atomic<bool> taken_{false};  ///< by a caller
  std::atomic<int> next_{0};
  // A helper announces itself in inside_ before it looks whether the round is open, the caller
  // closes it before it looks who is inside.
  std::atomic<bool> open_{false};
  std::atomic<int> inside_{0};
  int asleep_ = 0;  ///< under mutex_

  // Of the current round.
  Call call_ = nullptr;
  const void* task_ = nullptr;
  int task_count_ = 0;
  std::exception_ptr failure_;  ///< under mutex_
};

/// Calls task(0) to task(count − 1), shared out where there is a pool.
template <class Task>
void run_tasks(ThreadPool* pool, int count, const Task& task) {
  if (pool)
    pool->run(count, task);
  else
    for (int i = 0; i < count; ++i) task(i);
}

/// As parallel_for(), shared out where there is a pool.
template <class Body>
void in_ranges(ThreadPool* pool, int64_t count, int64_t least, const Body& body) {
  if (pool)
    pool->parallel_for(count, least, body);
  else if (count > 0)
    body(int64_t{0}, count);
}

}  // namespace dd
