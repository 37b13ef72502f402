// SPDX-License-Identifier: GPL-3.0-or-later
// Meshes and structs in the form that the C ABI takes.
#pragma once

#include <cstdint>
#include <vector>

#include "detail_deform/detail_deform.hpp"
#include "mesh/mesh.h"

namespace dd::test {

/// A mesh as the ABI takes it.
struct FlatMesh {
  std::vector<float> positions;
  std::vector<int32_t> triangles;

  FlatMesh() = default;
  explicit FlatMesh(const Mesh& mesh)
      : triangles(mesh.triangles.data(), mesh.triangles.data() + mesh.triangles.size()) {
    positions.reserve(static_cast<size_t>(mesh.positions.size()));
    for (Index k = 0; k < mesh.positions.size(); ++k)
      positions.push_back(static_cast<float>(mesh.positions.data()[k]));
  }
  size_t vertex_count() const { return positions.size() / 3; }
  size_t triangle_count() const { return triangles.size() / 3; }
  dd_mesh mesh() const {
    return {detail_deform::points(positions), triangles.data(), triangle_count()};
  }
};

/// A struct for a call to fill in, with its struct_size set.
template <class Options>
Options defaults() {
  Options options{};
  options.struct_size = sizeof options;
  return options;
}

}  // namespace dd::test
