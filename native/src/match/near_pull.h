// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace dd {

/// The pull of what is so far, in lengths at which it falls to a quarter: the weight that goes with
/// the error of Geman and McClure 1987.
inline double near_pull(double distance) { return 1 / std::pow(1 + distance * distance, 2); }

/// Of one value at least; of an even number the larger of both in the middle.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace dd
