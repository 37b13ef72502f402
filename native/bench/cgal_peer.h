// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "meshes.h"

namespace dd::bench {

/// CGAL's as-rigid-as-possible deformations on the same constraints, for comparison.
enum class CgalMethod { arap, smoothed_rotations };
Positions deform_with_cgal(const Mesh& mesh, const std::vector<int>& roles,
                           const test::Affine& motion, CgalMethod method, int iterations);

}  // namespace dd::bench
