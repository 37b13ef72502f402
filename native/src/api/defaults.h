// SPDX-License-Identifier: GPL-3.0-or-later
// The defaults of all options: what a null pointer stands for, and what _init() fills in.
#pragma once

#include "detail_deform/detail_deform.h"
#include "match/registration.h"
#include "methods/method.h"
#include "support/thread_pool.h"

namespace dd::api {

inline dd_bind_options bind_defaults() {
  dd_bind_options options{};
  options.smoothness = DD_SMOOTHNESS_THIN_PLATE;
  options.threads = usual_thread_count();
  return options;
}

inline dd_refinement_options refinement_defaults() {
  dd_refinement_options options{};
  options.iterations = 4;
  options.rotation_smoothing = Refined{}.rotation_smoothing;
  options.rim_smoothing = 0.05;
  options.solidity = 1;
  return options;
}

inline dd_normal_options normal_defaults() {
  dd_normal_options options{};
  options.levels = MethodOptions{}.levels;
  return options;
}

inline dd_volumes_options volumes_defaults() {
  dd_volumes_options options{};
  options.iterations = MethodOptions{}.volume_iterations;
  options.tolerance = MethodOptions{}.volume_tolerance;
  return options;
}

inline dd_examples_options examples_defaults() {
  dd_examples_options options{};
  options.stiffness = MethodOptions{}.example_stiffness;
  return options;
}

inline dd_update_options update_defaults() {
  dd_update_options options{};
  options.steps = 1;
  return options;
}

inline dd_transfer_options transfer_defaults() {
  dd_transfer_options options{};
  options.threads = usual_thread_count();
  options.precision = DD_PRECISION_DOUBLE;
  options.gap = 0.005;
  return options;
}

inline dd_apply_options apply_defaults() {
  dd_apply_options options{};
  options.gradients = DD_GRADIENTS_WHOLE;
  return options;
}

inline dd_match_options match_defaults() {
  const RegistrationOptions usual;
  dd_match_options options{};
  options.stages = usual.stages;
  options.rounds = usual.rounds;
  options.threads = usual_thread_count();
  options.smoothness = usual.smoothness;
  return options;
}

inline dd_riders_options riders_defaults() {
  dd_riders_options options{};
  options.threads = usual_thread_count();
  return options;
}

inline dd_measure_options measure_defaults() { return {}; }

}  // namespace dd::api
