// SPDX-License-Identifier: GPL-3.0-or-later
// Arguments of binds and updates, made from bytes. They own what they point to, and may be moved.
#pragma once

#include <optional>

#include "checks.h"
#include "meshes.h"
#include "points.h"

namespace dd::fuzz {

/// The arguments of a bind.
struct Bind {
  Surface surface;
  Points base;
  std::vector<int32_t> base_triangles;
  std::vector<Points> examples;
  std::vector<dd_points> given_examples;
  std::vector<float> stiffness;
  /// The options as the library reads them, and as they are passed: null, or of another size.
  dd_bind_options options{};
  std::shared_ptr<Sized<dd_bind_options>> given;
  bool tame = false;   ///< must not be refused
  bool wrong = false;  ///< must be refused

  dd_status start(dd_job** job, Bytes& bytes) const;
  /// The same bind with valid arguments and all points packed, by so many threads.
  Owned<dd_deformer> made(int32_t threads) const;
};
Bind any_bind(Bytes& bytes);

/// The arguments of an update.
struct Motion {
  std::vector<double> matrices, turns, weights, pivots, limits;
  Points base;
  std::vector<int32_t> handle_turns;
  std::optional<Sized<dd_refinement_options>> refinement;
  std::optional<Sized<dd_normal_options>> normal;
  std::optional<Sized<dd_volumes_options>> volumes;
  std::optional<Sized<dd_examples_options>> examples;
  dd_update_options options{};
  std::shared_ptr<Sized<dd_update_options>> given;
  bool tame = false;
  bool wrong = false;
  /// One that only ends when it is cancelled.
  bool endless = false;

  const dd_update_options* how() const { return given ? given->get() : nullptr; }
  /// Whether weights are given, with which handles don't have to be met.
  bool by_weights() const;
};
Motion any_motion(const Bind& bind, Bytes& bytes);

/// Checks the header's promises about fixed vertices, handles' vertices and loose ones.
void constraints_met(const Bind& bind, const Motion& motion, const Output& out);

/// Checks that facts agree with one another and with the mesh.
void facts_agree(const Bind& bind, const dd_deformer* deformer, Bytes& bytes);

}  // namespace dd::fuzz
