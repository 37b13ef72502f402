// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>

#include "support/error.h"

namespace dd {

/// What is being done. The values are those of dd_stage in the public header.
enum class Stage {
  starting = 0,
  operators,
  poisson,
  energy,
  base,
  handles,
  energy_on_base,
  deforming,
  volumes,
  restoring,
  meshes,
  functions,
  placements,
  map,
  sides,
  placing,
  fitting,
  correspondence,
  done,
};

/// Callback before each stage of a job, and at times within one: the fraction done, and the stage.
/// Returning false cancels.
using Progress = std::function<bool(double fraction, Stage stage)>;

inline void report(const Progress& progress, double fraction, Stage stage) {
  if (progress && !progress(fraction, stage)) throw Error(Status::cancelled, "It was cancelled");
}

/// Progress of a part of the work: maps its fractions 0 to 1 to begin to end of the whole. `whole`
/// must outlive it.
inline Progress within(const Progress& whole, double begin, double end) {
  if (!whole) return {};
  return [&whole, begin, end](double fraction, Stage stage) {
    return whole(begin + fraction * (end - begin), stage);
  };
}

}  // namespace dd
