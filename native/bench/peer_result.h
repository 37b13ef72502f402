// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "support/types.h"

namespace dd::bench {

/// A surface deformed by another library, and the times that it took.
struct PeerResult {
  Positions deformed;
  double preparing_ms = 0, moving_ms = 0;
};

}  // namespace dd::bench
