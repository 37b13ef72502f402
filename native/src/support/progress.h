// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>

#include "support/error.h"

namespace dd {

/// Told of each stage of a bind before it starts: the fraction done and what comes next (static
/// text). Returning false cancels.
using Progress = std::function<bool(double fraction, const char* stage)>;

inline void report(const Progress& progress, double fraction, const char* stage) {
  if (progress && !progress(fraction, stage)) throw Error(Status::cancelled, "It was cancelled.");
}

/// Progress of a part of the work: 0 to 1 there are begin to end of the whole.
inline Progress within(const Progress& whole, double begin, double end) {
  if (!whole) return {};
  return [&whole, begin, end](double fraction, const char* stage) {
    return whole(begin + fraction * (end - begin), stage);
  };
}

}  // namespace dd
