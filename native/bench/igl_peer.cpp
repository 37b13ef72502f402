// SPDX-License-Identifier: GPL-3.0-or-later
#include "igl_peer.h"

#include <igl/arap.h>
#include <igl/harmonic.h>
#include <igl/min_quad_with_fixed.h>

#include "timing.h"

namespace dd::bench {

PeerResult deform_with_igl(const Mesh& mesh, const std::vector<int>& roles,
                           const test::Affine& motion, IglMethod method, int iterations) {
  const Eigen::MatrixXd rest = mesh.positions;
  const Eigen::MatrixXi triangles = mesh.triangles;
  std::vector<int> list;
  for (size_t v = 0; v < roles.size(); ++v)
    if (roles[v] != kFree) list.push_back(static_cast<int>(v));
  const Eigen::VectorXi held = Eigen::Map<const Eigen::VectorXi>(list.data(), Index(list.size()));
  Eigen::MatrixXd target(held.size(), 3);
  for (Index i = 0; i < held.size(); ++i) {
    target.row(i) = rest.row(held[i]);
    if (roles[size_t(held[i])] >= 0) target.row(i) = test::transformed(motion, target.row(i));
  }

  PeerResult result;
  Eigen::MatrixXd deformed = rest;
  if (method == IglMethod::arap) {
    igl::ARAPData data;
    data.max_iter = iterations;
    const auto prepare = Clock::now();
    igl::arap_precomputation(rest, triangles, 3, held, data);
    result.preparing_ms = milliseconds_since(prepare);
    const auto move = Clock::now();
    igl::arap_solve(target, data, deformed);
    result.moving_ms = milliseconds_since(move);
  } else {
    const auto prepare = Clock::now();
    Eigen::SparseMatrix<double> energy;
    igl::harmonic(rest, triangles, 2, energy);
    igl::min_quad_with_fixed_data<double> data;
    igl::min_quad_with_fixed_precompute(energy, held, Eigen::SparseMatrix<double>(), true, data);
    result.preparing_ms = milliseconds_since(prepare);
    const auto move = Clock::now();
    Eigen::MatrixXd displaced = target;
    for (Index i = 0; i < held.size(); ++i) displaced.row(i) -= rest.row(held[i]);
    Eigen::MatrixXd displacement;
    igl::min_quad_with_fixed_solve(data, Eigen::MatrixXd::Zero(rest.rows(), 3).eval(), displaced,
                                   Eigen::MatrixXd(), displacement);
    deformed += displacement;
    result.moving_ms = milliseconds_since(move);
  }
  result.deformed = deformed;
  return result;
}

}  // namespace dd::bench
