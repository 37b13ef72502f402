// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <future>
#include <system_error>

namespace dd {

/// Starts work in a thread of its own; where there is to be one alone, or none to be had, it runs
/// when its result is asked for. threads: that may be at work; 0: as many as there are.
template <class Work>
auto beside(int threads, const Work& work) {
  if (threads != 1) {
    try {
      return std::async(std::launch::async, work);
    } catch (const std::system_error&) {
    }
  }
  return std::async(std::launch::deferred, work);
}

}  // namespace dd
