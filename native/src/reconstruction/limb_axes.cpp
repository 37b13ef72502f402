// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/limb_axes.h"

#include <Eigen/Eigenvalues>
#include <vector>

#include "mesh/triangles.h"

namespace dd {

namespace {

// Times that sums are taken over one-rings. Tuned: with 1, relief hides the limb; 8 do no more.
constexpr int kRounds = 4;

}  // namespace

Positions limb_axes(const FactoredSurface& surface) {
  const Mesh& mesh = surface.mesh;
  const PoissonSystem& poisson = *surface.poisson;
  const std::vector<int> faces = surface.faces_with_free_corners();
  const auto count = static_cast<Index>(faces.size());
  // Active indices; -1 where the active triangles, which may be others than the faces, have no such
  // corner.
  Triangles corners(count, 3);
  // The upper triangles of the symmetric matrices.
  using Tensors = Eigen::Matrix<double, Eigen::Dynamic, 6, Eigen::RowMajor>;
  Tensors of_faces(count, 6), of_vertices(poisson.active_vertex_count(), 6);
  for (Index i = 0; i < count; ++i) {
    const auto face = mesh.triangles.row(faces[size_t(i)]);
    for (int k = 0; k < 3; ++k) corners(i, k) = poisson.active_index_of_vertex(face[k]);
    const Eigen::Matrix3d frame =
        edges_and_normal(mesh.positions, mesh.triangles, faces[size_t(i)]);
    const auto n = frame.col(2);
    of_faces.row(i) << n[0] * n[0], n[0] * n[1], n[0] * n[2], n[1] * n[1], n[1] * n[2], n[2] * n[2];
    of_faces.row(i) *= frame.col(0).cross(frame.col(1)).norm();
  }
  for (int round = 0; round < kRounds; ++round) {
    if (round > 0)
      for (Index i = 0; i < count; ++i) {
        of_faces.row(i).setZero();
        for (int v : corners.row(i))
          if (v >= 0) of_faces.row(i) += of_vertices.row(v);
      }
    of_vertices.setZero();
    for (Index i = 0; i < count; ++i)
      for (int v : corners.row(i))
        if (v >= 0) of_vertices.row(v) += of_faces.row(i);
  }
  Positions axes(of_vertices.rows(), 3);
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver;
  for (Index i = 0; i < axes.rows(); ++i) {
    const auto t = of_vertices.row(i);
    Eigen::Matrix3d tensor;
    tensor << t[0], t[1], t[2], t[1], t[3], t[4], t[2], t[4], t[5];
    solver.computeDirect(tensor);
    axes.row(i) = solver.eigenvectors().col(0).transpose();
  }
  return axes;
}

}  // namespace dd
