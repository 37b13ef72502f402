// SPDX-License-Identifier: GPL-3.0-or-later
// What every function of the C ABI does: exceptions become a status and a description.
#pragma once

#include <atomic>
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include "detail_deform/detail_deform.h"
#include "support/error.h"

namespace dd::api {

/// What went wrong, in plain arrays: it needs no destructor at thread exit, which the library might
/// not live to see.
struct Problem {
  dd_status status = DD_OK;
  Subject subject;
  Remedy remedy = Remedy::none;
  char message[1024] = "";  // dd_error.message
  char text[1024] = "";     // dd_last_message()

  void set(const Error& error) noexcept {
    set(static_cast<dd_status>(error.status()), error.message().c_str(), error.what());
    subject = error.subject();
    remedy = error.remedy();
  }
  void set(dd_status its_status, const char* its_message, const char* its_text) noexcept {
    status = its_status;
    subject = {};
    remedy = Remedy::none;
    std::snprintf(message, sizeof message, "%s", its_message);
    std::snprintf(text, sizeof text, "%s", its_text);
  }
};

inline thread_local Problem last_problem;

/// Runs the body of a C function; whatever it throws becomes this thread's last problem.
template <class Body>
dd_status guarded(Body&& body) noexcept {
  try {
    body();
    return DD_OK;
  } catch (const Error& error) {
    last_problem.set(error);
  } catch (const std::bad_alloc&) {
    last_problem.set(DD_ERROR_MEMORY, "There is not enough memory for a mesh of this size",
                     "There is not enough memory for a mesh of this size.");
    last_problem.remedy = Remedy::free_resources;
  } catch (const std::exception& error) {
    last_problem.set(DD_ERROR_INTERNAL, error.what(), error.what());
  } catch (...) {
    last_problem.set(DD_ERROR_INTERNAL, "An unknown error occurred", "An unknown error occurred.");
  }
  return last_problem.status;
}

using dd::require;

/// The use of an object by one call or one job at a time, from here to its end or release().
class InUse {
 public:
  InUse(std::atomic<bool>& flag, const char* what) : flag_(&flag) {
    if (flag.exchange(true))
      throw Error(Status::busy, std::string("This ") + what + " is in use by another thread",
                  Remedy::wait);
  }
  InUse(InUse&& other) noexcept : flag_(other.flag_) { other.flag_ = nullptr; }
  InUse& operator=(InUse&&) = delete;
  ~InUse() { release(); }

  void release() {
    if (flag_) *flag_ = false;
    flag_ = nullptr;
  }

 private:
  std::atomic<bool>* flag_;
};

}  // namespace dd::api
