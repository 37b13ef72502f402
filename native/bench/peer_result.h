// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "support/types.h"

namespace dd::bench {

/// What another library made of a surface, and how long that took.
struct PeerResult {
  Positions deformed;
  double preparing_ms = 0, moving_ms = 0;
};

}  // namespace dd::bench
