// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/rotated_flux.h"

#include <Eigen/Geometry>

namespace dd {

RotatedFlux::RotatedFlux(const FactoredSurface& surface, const Positions& of, const Rows& rotations)
    : surface_(surface),
      rotations_(rotations),
      pass_(surface, of, [&](int v) { return surface.order().row_of_vertex[v]; }) {
  Rows still = Rows::Zero(surface.order().count(), 4);
  still.col(3).setOnes();
  at_rest_ = pass_.all(still.data());
}

Eigen::Matrix3d RotatedFlux::at(int triangle) const {
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  for (int k = 0; k < 3; ++k) {
    const int row = surface_.order().row_of_vertex[surface_.mesh.triangles(triangle, k)];
    sum += rotations_.row(row).transpose();
  }
  return Eigen::Quaterniond(sum).normalized().toRotationMatrix();
}

double RotatedFlux::bytes() const {
  return pass_.bytes() + static_cast<double>(at_rest_.size() * Index(sizeof(double)));
}

}  // namespace dd
