// SPDX-License-Identifier: GPL-3.0-or-later
// Binds and updates from bytes. What they point to they own, and may be moved with it.
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
  /// As the library knows them, and as they are given to it: maybe null, or of another size.
  dd_bind_options options{};
  std::shared_ptr<Sized<dd_bind_options>> given;
  bool tame = false;   ///< then there is nothing to refuse
  bool wrong = false;  ///< then there is

  dd_status start(dd_job** job, Bytes& bytes) const;
  /// Without anything odd, all points packed, with so many threads.
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
  /// Whether weights are given, by which the handles are let go.
  bool by_weights() const;
};
Motion any_motion(const Bind& bind, Bytes& bytes);

/// What the header says of fixed vertices, handles' vertices and loose ones.
void constraints_met(const Bind& bind, const Motion& motion, const Output& out);

/// Facts that agree with one another and with the mesh.
void facts_agree(const Bind& bind, const dd_deformer* deformer, Bytes& bytes);

}  // namespace dd::fuzz
