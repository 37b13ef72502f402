// SPDX-License-Identifier: GPL-3.0-or-later
// Options of binds and updates, checked and taken over.
#pragma once

#include "api/arguments.h"
#include "deform/split_motion.h"

namespace dd::api {

/// A bind, with all that it depends on beside the mesh and its roles.
struct Bind {
  BindOptions options;
  bool with_draft = false;
};

Bind read_bind_options(const dd_bind_options* given, size_t vertex_count);

enum class Values { positions = 0, offsets = 1 };

/// One update, with all that it depends on beside the deformer.
struct Update {
  UpdateOptions options;
  SplitMotion motion;
  Positions deformed_base;  // empty: none is given
  Values values = Values::positions;

  const Positions* base() const { return deformed_base.size() ? &deformed_base : nullptr; }
};

/// All but the matrices, which an update that is no job reads where they are.
Update read_update_options(const dd_update_options* given, const Deformer& deformer);

inline bool rotations_only(dd_gradients gradients) {
  return choice("options.gradients", gradients, DD_GRADIENTS_WHOLE) == DD_GRADIENTS_ROTATIONS;
}

}  // namespace dd::api
