// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "meshes.h"
#include "peer_result.h"

namespace dd::bench {

enum class IglMethod { arap, biharmonic };

/// The mesh with handle 0 moved, by libigl: as rigid as possible in so many iterations, or by the
/// smoothest displacement.
PeerResult deform_with_igl(const Mesh& mesh, const std::vector<int>& roles,
                           const test::Affine& motion, IglMethod method, int iterations = 1);

}  // namespace dd::bench
