// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <chrono>

namespace dd::bench {

using Clock = std::chrono::steady_clock;

inline double milliseconds_since(Clock::time_point start) {
  return 1e3 * std::chrono::duration<double>(Clock::now() - start).count();
}

template <class Body>
double milliseconds(const Body& body) {
  const auto start = Clock::now();
  body();
  return milliseconds_since(start);
}

}  // namespace dd::bench
