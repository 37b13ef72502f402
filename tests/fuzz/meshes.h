// SPDX-License-Identifier: GPL-3.0-or-later
// Meshes from bytes, with the faults that real ones have, or impossible ones.
#pragma once

#include "bytes.h"
#include "flat_mesh.h"

namespace dd::fuzz {

/// A mesh with roles, of a few dozen to a few hundred vertices. In a wild input it may be one that
/// has to be refused.
struct Surface : test::FlatMesh {
  using test::FlatMesh::FlatMesh;
  std::vector<int32_t> roles;
  int32_t handle_count = 0;
  /// Without faults: doubled, turned and missing faces, fins, loose vertices, no area, wide ranges
  /// of size and place. These are for no refusal either, but results may be less than exact.
  bool sound = true;
};
Surface any_surface(Bytes& bytes);

/// What a wild input does to coordinates: one is another number.
void disturb(std::vector<float>& positions, Bytes& bytes);

/// Other places of the same vertices: turned, stretched, waved, flattened or thrown together.
std::vector<float> posed(const std::vector<float>& positions, Bytes& bytes);

/// The largest difference of two coordinates, which is what rounding is compared with.
double extent(const std::vector<float>& positions);

}  // namespace dd::fuzz
