// SPDX-License-Identifier: GPL-3.0-or-later
#include "cgal_peer.h"

#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_deformation.h>

#include "timing.h"

namespace dd::bench {

namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using Surface = CGAL::Surface_mesh<Kernel::Point_3>;

template <CGAL::Deformation_algorithm_tag algorithm>
PeerResult deformed(const Mesh& mesh, const std::vector<int>& roles, const test::Affine& motion,
                    int iterations) {
  Surface surface;
  std::vector<Surface::Vertex_index> vertices;
  for (Index v = 0; v < mesh.positions.rows(); ++v)
    vertices.push_back(
        surface.add_vertex({mesh.positions(v, 0), mesh.positions(v, 1), mesh.positions(v, 2)}));
  for (Index j = 0; j < mesh.triangles.rows(); ++j)
    surface.add_face(vertices[size_t(mesh.triangles(j, 0))], vertices[size_t(mesh.triangles(j, 1))],
                     vertices[size_t(mesh.triangles(j, 2))]);
  using Deformation =
      CGAL::Surface_mesh_deformation<Surface, CGAL::Default, CGAL::Default, algorithm>;
  Deformation deformation(surface);
  for (size_t v = 0; v < vertices.size(); ++v) {
    deformation.insert_roi_vertex(vertices[v]);
    if (roles[v] != kFree) deformation.insert_control_vertex(vertices[v]);
  }
  const auto prepare = Clock::now();
  deformation.preprocess();
  PeerResult result;
  result.preparing_ms = milliseconds_since(prepare);
  const auto move = Clock::now();
  for (size_t v = 0; v < vertices.size(); ++v) {
    if (roles[v] < 0) continue;
    const Eigen::RowVector3d p = test::transformed(motion, mesh.positions.row(Index(v)));
    deformation.set_target_position(vertices[v], {p[0], p[1], p[2]});
  }
  deformation.deform(static_cast<unsigned>(iterations), 0.0);
  result.moving_ms = milliseconds_since(move);
  result.deformed.resize(mesh.positions.rows(), 3);
  for (size_t v = 0; v < vertices.size(); ++v) {
    const auto& p = surface.point(vertices[v]);
    result.deformed.row(Index(v)) << p.x(), p.y(), p.z();
  }
  return result;
}

}  // namespace

PeerResult deform_with_cgal(const Mesh& mesh, const std::vector<int>& roles,
                            const test::Affine& motion, CgalMethod method, int iterations) {
  return method == CgalMethod::arap
             ? deformed<CGAL::SPOKES_AND_RIMS>(mesh, roles, motion, iterations)
             : deformed<CGAL::SRE_ARAP>(mesh, roles, motion, iterations);
}

}  // namespace dd::bench
