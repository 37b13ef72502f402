// SPDX-License-Identifier: GPL-3.0-or-later
#include "meshes.h"

#include <algorithm>

#include "random_meshes.h"

namespace dd::fuzz {

namespace {

/// Adds one fault for which no mesh is refused.
void spoil(Mesh& mesh, Bytes& bytes) {
  const int n = mesh.vertex_count(), m = mesh.triangle_count();
  const int v = bytes.below(n), w = bytes.below(n), t = bytes.below(m);
  const auto add_vertex = [&](const Eigen::RowVector3d& place) {
    mesh.positions.conservativeResize(n + 1, 3);
    mesh.positions.row(n) = place;
    return n;
  };
  const auto add_triangle = [&](int a, int b, int c) {
    if (a == b || b == c || c == a) return;
    mesh.triangles.conservativeResize(m + 1, 3);
    mesh.triangles.row(m) << a, b, c;
  };
  const Eigen::RowVector3d place = mesh.positions.row(v);
  switch (bytes.below(11)) {
    case 0:  // a loose vertex
      add_vertex(2 * place);
      break;
    case 1:  // a vertex that lies on another one
      mesh.positions.row(w) = place;
      break;
    case 2:  // a fin on an edge
      add_triangle(mesh.triangles(t, 0), mesh.triangles(t, 1), add_vertex(1.3 * place));
      break;
    case 3:  // a doubled face
      add_triangle(mesh.triangles(t, 0), mesh.triangles(t, 1), mesh.triangles(t, 2));
      break;
    case 4:  // a flipped face
      std::swap(mesh.triangles(t, 0), mesh.triangles(t, 1));
      break;
    case 5:  // a hole
      if (m > 8) {
        mesh.triangles.row(t) = mesh.triangles.row(m - 1).eval();
        mesh.triangles.conservativeResize(m - 1, 3);
      }
      break;
    case 6:  // a face across the mesh
      add_triangle(v, w, mesh.triangles(t, 0));
      break;
    case 7:  // almost flat
      mesh.positions.col(bytes.below(3)) *= std::pow(10, -bytes.below(16));
      break;
    case 8:  // nearly a point
      for (int k = 0; k < 3; ++k)
        mesh.positions.row(mesh.triangles(t, k)) =
            place +
            std::pow(10, -bytes.below(12)) * (mesh.positions.row(mesh.triangles(t, k)) - place);
      break;
    case 9:  // vertices on a line
      mesh.positions.row(mesh.triangles(t, 0)) = 0.5 * (mesh.positions.row(mesh.triangles(t, 1)) +
                                                        mesh.positions.row(mesh.triangles(t, 2)));
      break;
    default:  // a vertex far away from the others
      mesh.positions.row(v) *= std::pow(10, bytes.below(10));
  }
}

/// Adds a fault for which the mesh has to be refused.
void break_mesh(test::FlatMesh& mesh, Bytes& bytes) {
  switch (bytes.below(4)) {
    case 0:
      disturb(mesh.positions, bytes);
      break;
    case 1:
      if (!mesh.triangles.empty())
        mesh.triangles[bytes.below(static_cast<int>(mesh.triangles.size()))] =
            bytes.beyond(mesh.vertex_count());
      break;
    case 2:
      mesh.triangles.clear();
      break;
    default:
      mesh.positions.clear();
  }
}

}  // namespace

Surface any_surface(Bytes& bytes) {
  const auto shape = static_cast<test::Shape>(bytes.below(test::kShapeCount));
  const unsigned seed = bytes.seed();
  Mesh mesh = test::random_mesh(shape, seed, bytes.one_in(6) ? 1 : 0);
  const int faults = bytes.flag() ? bytes.below(5) : 0;
  for (int k = 0; k < faults; ++k) spoil(mesh, bytes);
  const std::vector<int> roles = test::random_roles(mesh, bytes.seed(), 1 + bytes.below(3));
  if (bytes.one_in(4)) {  // another unit, another place
    mesh.positions *= std::pow(10, bytes.below(11) - 5);
    mesh.positions.rowwise() +=
        Eigen::RowVector3d(bytes.between(-9, 9), bytes.between(-9, 9), bytes.between(-9, 9)) *
        mesh.positions.cwiseAbs().maxCoeff();
  }
  if (bytes.odd(32)) mesh.positions *= std::pow(10, bytes.below(60) - 30);
  Surface surface(mesh);
  surface.sound = faults == 0;
  surface.roles.assign(roles.begin(), roles.end());
  surface.handle_count = std::max(0, *std::max_element(roles.begin(), roles.end()) + 1);
  if (bytes.odd(12)) break_mesh(surface, bytes);
  surface.roles.resize(surface.vertex_count(), DD_ROLE_FREE);
  if (bytes.odd() && !surface.roles.empty())
    surface.roles[bytes.below(static_cast<int>(surface.roles.size()))] = bytes.role();
  if (bytes.odd(48)) surface.roles.assign(surface.roles.size(), bytes.below(4) - 2);
  if (bytes.odd(48)) surface.handle_count = bytes.choice(3);
  return surface;
}

void disturb(std::vector<float>& positions, Bytes& bytes) {
  if (positions.empty()) return;
  float& one = positions[bytes.below(static_cast<int>(positions.size()))];
  const double value = bytes.any();
  // The conversion of a double beyond the range of floats is undefined.
  one = std::abs(value) > std::numeric_limits<float>::max()
            ? std::copysign(std::numeric_limits<float>::infinity(), float(value > 0 ? 1 : -1))
            : static_cast<float>(value);
}

std::vector<float> posed(const std::vector<float>& positions, Bytes& bytes) {
  std::vector<float> result(positions);
  const Index n = static_cast<Index>(positions.size() / 3);
  if (n == 0) return result;
  Eigen::Map<Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>> rows(result.data(), n, 3);
  Positions p = rows.cast<double>();
  const double size = std::max(extent(positions), 1e-30);
  Eigen::Vector3d stretch(1, 1, 1);
  for (int c = 0; c < 3; ++c) stretch[c] = bytes.between(0.6, 1.6);
  const test::Affine turn = test::rotation_about(
      bytes.between(-3.2, 3.2), {bytes.between(-1, 1), bytes.between(-1, 1), 1.1}, {0, 0, 0},
      {size * bytes.between(-1, 1), 0, size * bytes.between(-1, 1)});
  if (bytes.one_in(16)) stretch[bytes.below(3)] = 0;  // flat
  if (bytes.one_in(32)) stretch.setZero();            // a point
  p = test::transformed(turn, p * stretch.asDiagonal());
  const double wave = bytes.between(0, 0.2) * size, length = bytes.between(0.5, 9) / size;
  p.col(2) += (wave * (length * p.col(0)).array().sin()).matrix();
  const double largest = 0.9 * double(std::numeric_limits<float>::max());
  rows = p.cwiseMax(-largest).cwiseMin(largest).cast<float>();
  if (bytes.odd(8)) disturb(result, bytes);
  return result;
}

double extent(const std::vector<float>& positions) {
  if (positions.empty()) return 0;
  const auto [low, high] = std::minmax_element(positions.begin(), positions.end());
  return double(*high) - double(*low);
}

}  // namespace dd::fuzz
