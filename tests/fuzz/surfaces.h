// SPDX-License-Identifier: GPL-3.0-or-later
// Binds and updates from bytes. What they point to they own, and may be moved with it.
#pragma once

#include "checks.h"
#include "meshes.h"

namespace dd::fuzz {

/// The arguments of a bind.
struct Bind {
  Surface surface;
  std::vector<float> base, examples;
  std::vector<int32_t> base_triangles;
  /// As the library knows them, and as they are given to it: maybe null, or of another size.
  dd_bind_options options{};
  std::shared_ptr<Sized<dd_bind_options>> given;
  bool tame = false;  ///< then there is nothing to refuse

  int32_t start(dd_job** job, Bytes& bytes) const;
  /// Without anything odd, with so many threads.
  Owned<dd_deformer> made(int32_t threads) const;
};
Bind any_bind(Bytes& bytes);

/// The arguments of an update.
struct Motion {
  std::vector<double> matrices, turns, weights, pivots, limits;
  std::vector<float> base;
  std::vector<int32_t> handle_turns;
  dd_update_options options{};
  std::shared_ptr<Sized<dd_update_options>> given;
  bool tame = false;
  /// One that only ends when it is cancelled.
  bool endless = false;

  const dd_update_options* how() const { return given ? given->get() : nullptr; }
};
Motion any_motion(const Bind& bind, Bytes& bytes);

/// What the header says of fixed vertices, handles' vertices and loose ones.
void constraints_met(const Bind& bind, const Motion& motion, const Output<float>& out);

/// Facts that agree with one another and with the mesh.
void facts_agree(const Bind& bind, const dd_deformer* deformer, Bytes& bytes);

}  // namespace dd::fuzz
