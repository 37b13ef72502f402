// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "meshes.h"

namespace dd::bench {

enum class IglMethod { arap, biharmonic };

struct IglResult {
  Positions deformed;
  double preparing_ms, moving_ms;
};

/// The mesh with handle 0 moved, by libigl: as rigid as possible in so many iterations, or by the
/// smoothest displacement.
IglResult deform_with_igl(const Mesh& mesh, const std::vector<int>& roles,
                          const test::Affine& motion, IglMethod method, int iterations = 1);

}  // namespace dd::bench
