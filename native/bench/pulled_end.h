// SPDX-License-Identifier: GPL-3.0-or-later
// A pose that any mesh can take.
#pragma once

#include <vector>

#include "cases.h"

namespace dd::bench {

struct PulledEnd {
  std::vector<int> roles;
  test::Affine motion;
};

/// The last 15% of the mesh along an axis, either way, are pulled out by 12% of the box and turned
/// by 40°. From the other end on, a fraction fixed_to of the length is fixed.
inline PulledEnd pulled_end(const Mesh& mesh, int axis, bool last, double fixed_to) {
  PulledEnd one;
  const Eigen::RowVector3d low = mesh.positions.colwise().minCoeff(),
                           size = mesh.positions.colwise().maxCoeff() - low;
  Eigen::RowVector3d centre(0, 0, 0);
  int held = 0;
  for (Index v = 0; v < mesh.positions.rows(); ++v) {
    const double along = (mesh.positions(v, axis) - low[axis]) / size[axis];
    const double way = last ? along : 1 - along;
    one.roles.push_back(way > 0.85 ? 0 : way < fixed_to ? kFixed : kFree);
    if (one.roles.back() != 0) continue;
    centre += mesh.positions.row(v);
    ++held;
  }
  Eigen::Vector3d out = Eigen::Vector3d::Zero(), about = out;
  out[axis] = (last ? 0.12 : -0.12) * size.norm();
  about[(axis + 1) % 3] = 1;
  one.motion = test::rotation_about(test::radians(40), about, centre / held, out);
  return one;
}

}  // namespace dd::bench
