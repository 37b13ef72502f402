// SPDX-License-Identifier: GPL-3.0-or-later
#include "dense_reference.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace dd::test {

Eigen::Vector3d triangle_normal(const Positions& p, const Triangles& t, Index j) {
  const Eigen::Vector3d a = p.row(t(j, 0)), b = p.row(t(j, 1)), c = p.row(t(j, 2));
  return (b - a).cross(c - a).normalized();
}

DenseOperators dense_operators(const Positions& p, const Triangles& t) {
  const Index n = p.rows(), m = t.rows();
  DenseOperators op{Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(n, n),
                    Eigen::MatrixXd::Zero(3 * m, n), Eigen::MatrixXd::Zero(3 * m, 3 * m)};
  const double pi = std::acos(-1.0);
  for (Index j = 0; j < m; ++j) {
    const Eigen::Vector3d x[3] = {p.row(t(j, 0)), p.row(t(j, 1)), p.row(t(j, 2))};
    const double area = 0.5 * (x[1] - x[0]).cross(x[2] - x[0]).norm();
    double angle[3];
    for (int k = 0; k < 3; ++k)
      angle[k] =
          std::acos((x[(k + 1) % 3] - x[k]).normalized().dot((x[(k + 2) % 3] - x[k]).normalized()));
    for (int k = 0; k < 3; ++k) {
      const int a = t(j, (k + 1) % 3), b = t(j, (k + 2) % 3);
      const double w = 0.5 / std::tan(angle[k]);
      op.L(a, a) += w, op.L(b, b) += w, op.L(a, b) -= w, op.L(b, a) -= w;

      const bool any_obtuse = std::max({angle[0], angle[1], angle[2]}) > pi / 2;
      const double to_next = (x[(k + 1) % 3] - x[k]).squaredNorm();
      const double to_last = (x[(k + 2) % 3] - x[k]).squaredNorm();
      op.M(t(j, k), t(j, k)) +=
          any_obtuse
              ? (angle[k] > pi / 2 ? area / 2 : area / 4)
              : (to_next / std::tan(angle[(k + 2) % 3]) + to_last / std::tan(angle[(k + 1) % 3])) /
                    8;
    }
    Eigen::Matrix3d system, right;  // (13)'s 3×3 system
    system << (x[0] - x[2]).transpose(), (x[1] - x[2]).transpose(),
        triangle_normal(p, t, j).transpose();
    right << 1, 0, -1, 0, 1, -1, 0, 0, 0;
    const Eigen::Matrix3d gradients = system.inverse() * right;
    for (int k = 0; k < 3; ++k) op.G.block<3, 1>(3 * j, t(j, k)) += gradients.col(k);
    op.D.block<3, 3>(3 * j, 3 * j) = area * Eigen::Matrix3d::Identity();
  }
  return op;
}

Positions dense_solve(const Eigen::MatrixXd& A, const Positions& values,
                      const std::vector<int>& roles, const Eigen::MatrixXd& right) {
  std::vector<int> free, held;
  for (size_t v = 0; v < roles.size(); ++v) (roles[v] == kFree ? free : held).push_back(int(v));
  const Eigen::MatrixXd rhs = right(free, kAllIndices) - A(free, held) * values(held, kAllIndices);
  const Eigen::MatrixXd x = A(free, free).fullPivLu().solve(rhs);
  Positions result = values;
  for (size_t r = 0; r < free.size(); ++r) result.row(free[r]) = x.row(Index(r));
  return result;
}

Eigen::Matrix3d deformation_gradient(const Positions& q, const Positions& q_new, const Triangles& t,
                                     Index j) {
  const auto columns = [&](const Positions& x) {
    Eigen::Matrix3d c;
    c << (x.row(t(j, 0)) - x.row(t(j, 2))).transpose(),
        (x.row(t(j, 1)) - x.row(t(j, 2))).transpose(), triangle_normal(x, t, j);
    return c;
  };
  return columns(q_new) * columns(q).inverse();
}

Eigen::Matrix3d polar_rotation(const Eigen::Matrix3d& S) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(S, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d R = svd.matrixU() * svd.matrixV().transpose();
  if (R.determinant() < 0) {
    Eigen::Matrix3d U = svd.matrixU();
    U.col(2) *= -1;
    R = U * svd.matrixV().transpose();
  }
  return R;
}

DenseResult dense_transfer(const Mesh& mesh, const std::vector<int>& roles,
                           const std::vector<Affine>& handles, bool on_base, bool rotation_only) {
  const Positions& p = mesh.positions;
  const Eigen::MatrixXd zero = Eigen::MatrixXd::Zero(p.rows(), 3);
  const DenseOperators on_s = dense_operators(p, mesh.triangles);
  const Eigen::MatrixXd K = on_s.L * on_s.M.inverse() * on_s.L;
  DenseResult result;
  result.base = dense_solve(K, p, roles, zero);

  Positions delta = zero;
  for (Index v = 0; v < p.rows(); ++v)
    if (roles[v] >= 0) delta.row(v) = transformed(handles[roles[v]], p.row(v)) - p.row(v);
  if (on_base) {
    const DenseOperators on_b = dense_operators(result.base, mesh.triangles);
    const Eigen::MatrixXd K_b = on_b.L * on_b.M.inverse() * on_b.L;
    delta = dense_solve(K_b, delta, roles, zero);
  } else {
    delta = dense_solve(K, delta, roles, zero);
  }
  result.base_deformed = result.base + delta;
  result.variational = p + delta;

  Eigen::MatrixXd gradients(3 * mesh.triangles.rows(), 3);
  for (Index j = 0; j < mesh.triangles.rows(); ++j) {
    Eigen::Matrix3d S = deformation_gradient(result.base, result.base_deformed, mesh.triangles, j);
    if (rotation_only) S = polar_rotation(S);
    gradients.middleRows<3>(3 * j) = S.transpose();
  }
  const Eigen::MatrixXd right = on_s.G.transpose() * on_s.D * gradients;
  result.surface = dense_solve(on_s.L, p + delta, roles, right);
  return result;
}

}  // namespace dd::test
