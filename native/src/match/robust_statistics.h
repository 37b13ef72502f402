// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace dd {

/// The weight that goes with the robust error of Geman and McClure (1987). distance: as a multiple
/// of the one at which the weight is 1/4.
inline double geman_mcclure_weight(double distance) {
  return 1 / std::pow(1 + distance * distance, 2);
}

/// The median of one or more values; of an even number, the larger of the two in the middle.
inline double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace dd
