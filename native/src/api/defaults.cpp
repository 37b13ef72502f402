// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: options filled with their defaults.
#include "api/defaults.h"

#include "api/arguments.h"

using namespace dd::api;

extern "C" {

dd_status dd_bind_options_init(dd_bind_options* options, size_t size) {
  return guarded([&] { init_struct(options, size, bind_defaults()); });
}

dd_status dd_refinement_options_init(dd_refinement_options* options, size_t size) {
  return guarded([&] { init_struct(options, size, refinement_defaults()); });
}

dd_status dd_normal_options_init(dd_normal_options* options, size_t size) {
  return guarded([&] { init_struct(options, size, normal_defaults()); });
}

dd_status dd_volumes_options_init(dd_volumes_options* options, size_t size) {
  return guarded([&] { init_struct(options, size, volumes_defaults()); });
}

dd_status dd_examples_options_init(dd_examples_options* options, size_t size) {
  return guarded([&] { init_struct(options, size, examples_defaults()); });
}

dd_status dd_update_options_init(dd_update_options* options, size_t size) {
  return guarded([&] { init_struct(options, size, update_defaults()); });
}

dd_status dd_transfer_options_init(dd_transfer_options* options, size_t size) {
  return guarded([&] { init_struct(options, size, transfer_defaults()); });
}

dd_status dd_apply_options_init(dd_apply_options* options, size_t size) {
  return guarded([&] { init_struct(options, size, apply_defaults()); });
}

dd_status dd_match_options_init(dd_match_options* options, size_t size) {
  return guarded([&] { init_struct(options, size, match_defaults()); });
}

dd_status dd_riders_options_init(dd_riders_options* options, size_t size) {
  return guarded([&] { init_struct(options, size, riders_defaults()); });
}

dd_status dd_measure_options_init(dd_measure_options* options, size_t size) {
  return guarded([&] { init_struct(options, size, measure_defaults()); });
}

}  // extern "C"
