// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "meshes.h"
#include "peer_result.h"

namespace dd::bench {

enum class CgalMethod { arap, smoothed_rotations };

/// The mesh with handle 0 moved, by CGAL's surface mesh deformation with its default solver, and
/// the whole mesh for its region of interest.
PeerResult deform_with_cgal(const Mesh& mesh, const std::vector<int>& roles,
                            const test::Affine& motion, CgalMethod method, int iterations);

}  // namespace dd::bench
