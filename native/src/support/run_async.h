// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <future>
#include <system_error>

namespace dd {

/// Starts work in a thread of its own and returns its std::future. If threads is 1, or the system
/// starts no thread, the work is deferred to the caller of get(). threads: how many may work at
/// once; 0: as many as the machine has.
template <class Work>
auto run_async(int threads, const Work& work) {
  if (threads != 1) {
    try {
      return std::async(std::launch::async, work);
    } catch (const std::system_error&) {
    }
  }
  return std::async(std::launch::deferred, work);
}

}  // namespace dd
