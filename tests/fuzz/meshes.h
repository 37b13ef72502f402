// SPDX-License-Identifier: GPL-3.0-or-later
// Meshes made from bytes, with the faults of real ones, or with faults for which they are refused.
#pragma once

#include "bytes.h"
#include "flat_mesh.h"

namespace dd::fuzz {

/// A mesh with roles, of a few dozen to a few hundred vertices. In a wild input it may have to be
/// refused.
struct Surface : test::FlatMesh {
  using test::FlatMesh::FlatMesh;
  std::vector<int32_t> roles;
  int32_t handle_count = 0;
  /// Without doubled, flipped and missing faces, fins, loose vertices, faces without area, wide
  /// ranges of size and place. A mesh with these isn't refused, but its results may be inexact.
  bool sound = true;
};
Surface any_surface(Bytes& bytes);

/// Replaces one coordinate by any number, in wild inputs.
void disturb(std::vector<float>& positions, Bytes& bytes);

/// A pose of the vertices: turned, stretched, waved, flattened or collapsed to a point.
std::vector<float> posed(const std::vector<float>& positions, Bytes& bytes);

/// The largest difference of two coordinates, by which rounding is judged.
double extent(const std::vector<float>& positions);

}  // namespace dd::fuzz
