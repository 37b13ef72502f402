// SPDX-License-Identifier: GPL-3.0-or-later
#include "support/thread_pool.h"

#include <array>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#if defined(__x86_64__) || defined(_M_X64)
#include <immintrin.h>
#endif

namespace dd {

namespace {

/// The default's limit, so that one surface doesn't fill a machine of many cores; callers may ask
/// for more.
constexpr int kMostThreads = 8;
/// How long a worker spins before it sleeps: several times the pause between parts of a frame.
constexpr auto kSpinTime = std::chrono::microseconds(200);
/// Callers that can share the workers at once; any further one runs its tasks itself.
constexpr int kMaxSharedRounds = 16;

void pause() {
#if defined(__x86_64__) || defined(_M_X64)
  _mm_pause();
#else
  std::this_thread::yield();
#endif
}

}  // namespace

int usual_thread_count() {
  return std::clamp(static_cast<int>(std::thread::hardware_concurrency()), 1, kMostThreads);
}

/// The worker threads, and the rounds of tasks that they help with.
class Workers {
 public:
  using Call = void (*)(const void* task, int index);

  ~Workers() {
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      leave_ = true;
      ++epoch_;
    }
    wake_.notify_all();
    for (std::thread& thread : threads_) thread.join();
  }

  /// The workers of the process: made by the first ThreadPool, destroyed with the last.
  static std::shared_ptr<Workers> shared() {
    static std::mutex mutex;
    static std::weak_ptr<Workers> existing;
    const auto found = [&] {
      const std::lock_guard<std::mutex> lock(mutex);
      return existing.lock();
    };
    if (auto workers = found()) return workers;
    // Made outside of the lock, which the deleter takes, also where this very allocation fails.
    std::shared_ptr<Workers> made(new Workers, [](Workers* last) {
      {
        const std::lock_guard<std::mutex> lock(mutex);
        if (existing.expired()) existing.reset();  // else another thread has made others meanwhile
      }
      delete last;
    });
    std::shared_ptr<Workers> kept;
    {
      const std::lock_guard<std::mutex> lock(mutex);
      kept = existing.lock();
      if (!kept) existing = kept = made;
    }
    return kept;
  }

  /// Starts threads until there are `wanted`; returns how many of these there are.
  int grow(int wanted) {
    const std::lock_guard<std::mutex> lock(mutex_);
    try {
      threads_.reserve(static_cast<size_t>(wanted));
      while (static_cast<int>(threads_.size()) < wanted) threads_.emplace_back([this] { help(); });
    } catch (const std::exception&) {
      // No result depends on their number: those that did start do the work.
    }
    return std::min(wanted, static_cast<int>(threads_.size()));
  }

  /// Runs a caller's tasks with at most `helpers` workers.
  void run(Call call, const void* task, int task_count, int helpers) {
    const int slot = take();
    if (slot < 0) {
      for (int i = 0; i < task_count; ++i) call(task, i);
      return;
    }
    Round& round = rounds_[static_cast<size_t>(slot)];
    round.call = call;
    round.task = task;
    round.task_count = task_count;
    round.helpers = helpers;
    round.next = 0;
    open_.fetch_or(1u << slot);
    bool sleepers;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      ++epoch_;
      sleepers = asleep_ > 0;
    }
    if (sleepers) wake_.notify_all();
    round.work();
    // A worker that comes late finds the round closed: nobody waits for one to wake up.
    open_.fetch_and(~(1u << slot));
    while (round.inside > 0) pause();
    const std::exception_ptr failure = std::exchange(round.failure, nullptr);
    taken_.fetch_and(~(1u << slot));
    if (failure) std::rethrow_exception(failure);
  }

 private:
  struct alignas(64) Round {
    Call call = nullptr;
    const void* task = nullptr;
    int task_count = 0;
    int helpers = 0;
    std::atomic<int> next{0};
    // A worker announces itself here before it looks whether the round is open; the caller closes
    // the round before it looks who is inside.
    std::atomic<int> inside{0};
    std::mutex failing;
    std::exception_ptr failure;

    void work() {
      try {
        for (int i; (i = next.fetch_add(1)) < task_count;) call(task, i);
      } catch (...) {
        next = task_count;
        const std::lock_guard<std::mutex> lock(failing);
        if (!failure) failure = std::current_exception();
      }
    }
  };

  /// A free round, or -1.
  int take() {
    uint32_t taken = taken_;
    for (int slot = 0; slot < kMaxSharedRounds;) {
      if (taken & (1u << slot))
        ++slot;
      else if (taken_.compare_exchange_weak(taken, taken | (1u << slot)))
        return slot;
    }
    return -1;
  }

  void help_with(int slot) {
    Round& round = rounds_[static_cast<size_t>(slot)];
    // helpers is only read where the round is seen open after the announcement, as call is.
    const int before = round.inside++;
    if ((open_ & (1u << slot)) && before < round.helpers) round.work();
    --round.inside;
  }

  void help() {
    for (unsigned seen = 0;;) {
      const auto until = std::chrono::steady_clock::now() + kSpinTime;
      while (epoch_ == seen) {
        for (int i = 0; i < 64 && epoch_ == seen; ++i) pause();
        if (std::chrono::steady_clock::now() < until) continue;
        std::unique_lock<std::mutex> lock(mutex_);
        ++asleep_;
        wake_.wait(lock, [&] { return epoch_ != seen; });
        --asleep_;
      }
      seen = epoch_;
      if (leave_) return;
      for (int slot = 0; slot < kMaxSharedRounds; ++slot)
        if (open_ & (1u << slot)) help_with(slot);
    }
  }

  std::mutex mutex_;
  std::vector<std::thread> threads_;  // under mutex_
  std::condition_variable wake_;
  std::atomic<unsigned> epoch_{0};  // grows with each round
  std::atomic<bool> leave_{false};
  int asleep_ = 0;                            // under mutex_
  std::atomic<uint32_t> taken_{0}, open_{0};  // a bit a round
  std::array<Round, kMaxSharedRounds> rounds_;
};

ThreadPool::ThreadPool(int count) {
  const int wanted = count > 0 ? count : usual_thread_count();
  if (wanted == 1) return;
  workers_ = Workers::shared();
  count_ = workers_->grow(wanted - 1) + 1;
}

ThreadPool::~ThreadPool() = default;

void ThreadPool::share(Call call, const void* task, int task_count) {
  struct Release {
    std::atomic<bool>& taken;
    ~Release() { taken = false; }
  } release{taken_};
  workers_->run(call, task, task_count, count_ - 1);
}

}  // namespace dd
