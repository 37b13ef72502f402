// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "meshes.h"

namespace dd::bench {

enum class CgalMethod { arap, smoothed_rotations };

struct CgalResult {
  Positions deformed;
  double preparing_ms, moving_ms;
};

/// The mesh with handle 0 moved, by CGAL's surface mesh deformation with its own choice of solver,
/// all of the mesh being its region of interest.
CgalResult deform_with_cgal(const Mesh& mesh, const std::vector<int>& roles,
                            const test::Affine& motion, CgalMethod method, int iterations);

}  // namespace dd::bench
