// SPDX-License-Identifier: GPL-3.0-or-later
// Work of the C ABI that goes on in a thread of the library.
#pragma once

#include <atomic>
#include <string>
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
    worker_ = std::thread([this, body = std::move(body)]() mutable {
      status_ = guarded([&] {
        body([this](double fraction, const char* stage) {
          fraction_ = fraction;
          stage_ = stage;
          return !cancelled_ || fraction >= 1;
        });
      });
      if (status_ != DD_OK) {
        try {
          message_ = last_message;
        } catch (...) {
          message_.clear();
        }
      }
      state_ = status_ == DD_OK ? DD_BIND_DONE : DD_BIND_FAILED;
    });
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
  std::string message_;
};

}  // namespace dd::c_api
