// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <memory>

namespace dd {

/// Least number of rows or triangles worth a task.
constexpr int kLeastRange = 512;
/// Tasks for each thread: with a single one, all would wait for a thread that was interrupted.
constexpr int kTasksPerThread = 4;

/// As many threads as the machine has, at most 8: what threads = 0 stands for.
int usual_thread_count();

class Workers;

/// Runs the tasks of one caller at a time on the process's worker threads, which all pools share; a
/// second caller, from another thread or from within a task, works alone. Workers exist as long as
/// any pool does. Between the parts of a frame, some tens of microseconds apart, they spin; else
/// they sleep.
class ThreadPool {
 public:
  /// count: the most threads at work for this pool, the caller among them; 0: usual_thread_count().
  /// Where the system starts no more threads there are fewer.
  explicit ThreadPool(int count = 0);
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  int count() const { return count_; }

  /// Calls task(0) to task(task_count − 1), each once, in any order and from any of the threads;
  /// returns when all are done. Rethrows the first exception.
  template <class Task>
  void run(int task_count, const Task& task) {
    if (task_count <= 1 || count_ == 1 || taken_.exchange(true)) {
      for (int i = 0; i < task_count; ++i) task(i);
      return;
    }
    share([](const void* of, int i) { (*static_cast<const Task*>(of))(i); }, &task, task_count);
  }

  /// Splits [0, item_count) into even ranges of at least `least` items, unless there are fewer, and
  /// calls body(begin, end) for each. The split depends on the number of threads.
  template <class Body>
  void parallel_for(int64_t item_count, int64_t least, const Body& body) {
    if (item_count == 0) return;
    const int64_t ranges =
        std::max<int64_t>(1, std::min<int64_t>(kTasksPerThread * count(), item_count / least));
    run(static_cast<int>(ranges),
        [&](int i) { body(item_count * i / ranges, item_count * (i + 1) / ranges); });
  }

 private:
  using Call = void (*)(const void* task, int index);
  /// For the caller that has set taken_; clears it.
  void share(Call call, const void* task, int task_count);

  std::shared_ptr<Workers> workers_;
  int count_ = 1;
  std::atomic<bool> taken_{false};
};

/// ThreadPool::run(), or a plain loop if pool is null.
template <class Task>
void run_tasks(ThreadPool* pool, int count, const Task& task) {
  if (pool)
    pool->run(count, task);
  else
    for (int i = 0; i < count; ++i) task(i);
}

/// ThreadPool::parallel_for(), or one range if pool is null.
template <class Body>
void in_ranges(ThreadPool* pool, int64_t count, int64_t least, const Body& body) {
  if (pool)
    pool->parallel_for(count, least, body);
  else if (count > 0)
    body(int64_t{0}, count);
}

}  // namespace dd
