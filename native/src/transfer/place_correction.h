// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "support/types.h"

namespace dd {

/// One step that moves a surface made of transferred gradients towards the places of its source:
/// (14) leaves the place of each component open, and determines places within one only as far as
/// gradients are integrable. A transfer runs its steps in a fixed order, see MeshTransfer.
class PlaceCorrection {
 public:
  virtual ~PlaceCorrection() = default;

  /// pose: S', which SourceGradients::set_pose() was called with, in the source's units. result:
  /// T', which this step moves, in the target's units.
  virtual void correct(const Positions& pose, Positions& result) = 0;
};

}  // namespace dd
