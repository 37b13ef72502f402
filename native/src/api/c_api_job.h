// SPDX-License-Identifier: GPL-3.0-or-later
// Work of the C ABI that goes on in a thread of the library.
#pragma once

#include <algorithm>
#include <atomic>
#include <system_error>
#include <thread>
#include <utility>

#include "api/c_api_support.h"
#include "support/progress.h"

namespace dd::c_api {

/// Work in a thread of its own that can be watched and cancelled.
class Job {
 public:
  ~Job() {
    cancelled_ = true;
    if (worker_.joinable()) worker_.join();
  }

  /// body: called with a Progress, in the thread.
  template <class Body>
  void start(Body body) {
    try {
      worker_ = std::thread([this, body = std::move(body)]() mutable {
        status_ = guarded([&] {
          body([this](double fraction, const char* stage) {
            fraction_ = fraction;
            stage_ = stage;
            return !cancelled_ || fraction >= 1;
          });
        });
        if (status_ != DD_OK) std::copy_n(last_message, sizeof message_, message_);
        state_ = status_ == DD_OK ? DD_BIND_DONE : DD_BIND_FAILED;
      });
    } catch (const std::system_error&) {
      throw Error(Status::memory,
                  "The system starts no more threads, and this work needs one: close other "
                  "programs, or raise the limits of threads and memory.");
    }
  }

  void poll(dd_bind_progress* progress) const {
    dd_bind_progress now{};
    now.state = state_;
    now.fraction = fraction_;
    now.stage = stage_;
    write_struct("progress", progress, now);
  }

  void cancel() { cancelled_ = true; }

  /// Waits; throws what the body threw.
  void finish() {
    if (worker_.joinable()) worker_.join();
    if (status_ != DD_OK) throw Error(static_cast<Status>(status_), message_);
  }

 private:
  std::thread worker_;
  std::atomic<double> fraction_{0};
  std::atomic<const char*> stage_{"Checking the mesh"};
  std::atomic<bool> cancelled_{false};
  std::atomic<int32_t> state_{DD_BIND_RUNNING};
  // Written by the worker before state_ leaves DD_BIND_RUNNING, read after.
  int32_t status_ = DD_OK;
  char message_[sizeof last_message] = "";  // plain: memory may be what is missing
};

}  // namespace dd::c_api
