// SPDX-License-Identifier: GPL-3.0-or-later
#include "volumetric_arap_peer.h"

#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "deform/split_motion.h"
#include "support/rotations.h"
#include "systems/tets.h"
#include "timing.h"

namespace dd::bench {

namespace {

constexpr int kMostIterations = 2000;
constexpr double kSmall = 1e-5;

/// A limb's tetrahedra. Vertices: for each ring its centre, then its layers from within, the last
/// of which is the surface's.
class SolidLimb {
 public:
  SolidLimb(const test::TaperedLimb& limb, int layers) : limb_(limb), layers_(layers) {
    mesh.positions.resize(Index(limb.rings) * per_ring(), 3);
    for (int i = 0; i < limb.rings; ++i) {
      const auto ring = limb.mesh.positions.middleRows(Index(i) * limb.sides, limb.sides);
      const Eigen::RowVector3d centre = ring.colwise().mean();
      mesh.positions.row(number(i, 0, 0)) = centre;
      for (int layer = 1; layer <= layers; ++layer)
        for (int j = 0; j < limb.sides; ++j)
          mesh.positions.row(number(i, layer, j)) =
              centre + double(layer) / layers * (ring.row(j) - centre);
      roles.insert(roles.end(), size_t(per_ring()), limb.roles[size_t(i) * size_t(limb.sides)]);
    }
    for (int i = 0; i + 1 < limb.rings; ++i)
      for (int j = 0; j < limb.sides; ++j) {
        const int k = (j + 1) % limb.sides;
        add_prism(i, {{{0, 0}, {1, j}, {1, k}}});
        for (int layer = 1; layer < layers; ++layer) {
          add_prism(i, {{{layer, j}, {layer + 1, j}, {layer + 1, k}}});
          add_prism(i, {{{layer, j}, {layer + 1, k}, {layer, k}}});
        }
      }
    mesh.tets.resize(Index(tets_.size()), 4);
    for (size_t t = 0; t < tets_.size(); ++t)
      for (int c = 0; c < 4; ++c) mesh.tets(Index(t), c) = tets_[t][size_t(c)];
  }

  /// The positions of the limb's surface.
  Positions surface(const Positions& solid) const {
    Positions p(limb_.mesh.vertex_count(), 3);
    for (int i = 0; i < limb_.rings; ++i)
      for (int j = 0; j < limb_.sides; ++j)
        p.row(Index(i) * limb_.sides + j) = solid.row(number(i, layers_, j));
    p.row(p.rows() - 2) = solid.row(number(0, 0, 0));
    p.row(p.rows() - 1) = solid.row(number(limb_.rings - 1, 0, 0));
    return p;
  }

  TetMesh mesh;
  std::vector<int> roles;

 private:
  int per_ring() const { return 1 + layers_ * limb_.sides; }
  int number(int ring, int layer, int side) const {
    return ring * per_ring() + (layer ? 1 + (layer - 1) * limb_.sides + side : 0);
  }

  /// Three tetrahedra between a triangle (layer, side) of a ring and that of the next one. The
  /// diagonals of its walls begin at the corner of the ring with the lower number, so that those of
  /// neighbours agree.
  void add_prism(int ring, std::array<std::array<int, 2>, 3> triangle) {
    std::sort(triangle.begin(), triangle.end());
    std::array<int, 3> low{}, high{};
    for (size_t c = 0; c < 3; ++c) {
      low[c] = number(ring, triangle[c][0], triangle[c][1]);
      high[c] = number(ring + 1, triangle[c][0], triangle[c][1]);
    }
    tets_.push_back({low[0], low[1], low[2], high[2]});
    tets_.push_back({low[0], low[1], high[1], high[2]});
    tets_.push_back({low[0], high[0], high[1], high[2]});
  }

  const test::TaperedLimb& limb_;
  int layers_;
  std::vector<std::array<int, 4>> tets_;
};

/// Each vertex moved by the part of the motion that is its height's share of the free length.
Positions spread(const SolidLimb& solid, const ScrewMotion& motion) {
  double bottom = 0, top = test::TaperedLimb::kLength;  // of the free length
  for (size_t v = 0; v < solid.roles.size(); ++v) {
    const double z = solid.mesh.positions(Index(v), 2);
    if (solid.roles[v] == kFixed) bottom = std::max(bottom, z);
    if (solid.roles[v] == 0) top = std::min(top, z);
  }
  Positions p(solid.mesh.vertex_count(), 3);
  for (Index v = 0; v < p.rows(); ++v) {
    const Eigen::RowVector3d x = solid.mesh.positions.row(v);
    const double share = std::clamp((x[2] - bottom) / (top - bottom), 0.0, 1.0);
    p.row(v) = (motion.at(share) * x.transpose().homogeneous()).transpose();
  }
  return p;
}

}  // namespace

VolumetricArapResult deform_with_volumetric_arap(const test::TaperedLimb& limb, int layers,
                                                 const test::Affine& motion,
                                                 const Eigen::Vector3d& turn) {
  const SolidLimb solid(limb, layers);
  VolumetricArapResult result;
  result.tets = solid.mesh.tet_count();
  std::unique_ptr<TetPoisson> poisson;
  result.factor_ms = milliseconds([&] {
    poisson = std::make_unique<TetPoisson>(solid.mesh, solid.roles, 1, gradient(solid.mesh),
                                           volumes(solid.mesh));
  });
  Positions p = spread(solid, ScrewMotion(motion, Eigen::Vector3d::Zero(), turn));
  const auto start = Clock::now();
  for (bool moves = true; moves && result.iterations < kMostIterations; ++result.iterations) {
    RowMatrix gradients = poisson->gradient_operator() * p;  // S_jᵀ
    for (Index j = 0; j < solid.mesh.tet_count(); ++j) {
      const Eigen::Matrix3d S = gradients.middleRows<3>(3 * j).transpose();
      gradients.middleRows<3>(3 * j) = polar_rotation(S).transpose();
    }
    const Positions next = poisson->solve(p, gradients);
    moves = (next - p).norm() > kSmall * p.norm();
    p = next;
  }
  result.iteration_ms = milliseconds_since(start) / result.iterations;
  result.positions = solid.surface(p);
  return result;
}

}  // namespace dd::bench
