// SPDX-License-Identifier: GPL-3.0-or-later
// What every function of the C ABI does: exceptions become a status and a sentence.
#pragma once

#include <atomic>
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include "detail_deform/detail_deform.h"
#include "support/error.h"

namespace dd::api {

// A plain array: it needs no destructor at thread exit, which the library might not live to see.
inline thread_local char last_message[1024] = "";

inline void remember(const char* sentence) {
  std::snprintf(last_message, sizeof last_message, "%s", sentence);
}

/// Runs the body of a C function; whatever it throws becomes a status and a sentence.
template <class Body>
int32_t guarded(Body&& body) noexcept {
  try {
    body();
    return DD_OK;
  } catch (const Error& error) {
    remember(error.what());
    return static_cast<int32_t>(error.status());
  } catch (const std::bad_alloc&) {
    remember("There is not enough memory for a mesh of this size.");
    return DD_ERROR_MEMORY;
  } catch (const std::exception& error) {
    remember(error.what());
    return DD_ERROR_INTERNAL;
  } catch (...) {
    remember("An unknown error occurred.");
    return DD_ERROR_INTERNAL;
  }
}

inline void require(bool condition, const std::string& sentence) {
  if (!condition) throw Error(Status::argument, sentence);
}

/// The use of an object by one call or one job at a time, from here to its end or release().
class InUse {
 public:
  InUse(std::atomic<bool>& flag, const char* what) : flag_(&flag) {
    if (flag.exchange(true))
      throw Error(Status::busy, std::string("This ") + what + " is in use by another thread.");
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
