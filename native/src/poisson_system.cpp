// SPDX-License-Identifier: GPL-3.0-or-later
#include "poisson_system.h"

#include "free_block.h"

namespace dd {

namespace {

RowOrder row_order(const Region& region, const std::vector<int>& factor_order) {
  RowOrder order;
  for (int r : factor_order) order.vertex_of_row.push_back(region.free[r]);
  order.free_count = order.count();
  for (int v : region.handle_vertices) order.vertex_of_row.push_back(v);
  order.fixed_begin = order.count();
  const int n = static_cast<int>(region.role.size());
  for (int v = 0; v < n; ++v)
    if (region.role[v] == kFixed) order.vertex_of_row.push_back(v);
  order.row_of_vertex.resize(static_cast<size_t>(n));
  for (int r = 0; r < n; ++r) order.row_of_vertex[order.vertex_of_row[r]] = r;
  return order;
}

/// A part that nothing holds leaves its translation open. A right-hand side that sums to zero over
/// it, as every divergence does, keeps the grounded vertex in place whatever its added weight.
SparseMatrix grounded(SparseMatrix block, const Region& region) {
  for (int v : region.grounds) block.coeffRef(region.row[v], region.row[v]) *= 2;
  return block;
}

}  // namespace

PoissonSystem::PoissonSystem(const Mesh& mesh, const Region& region,
                             const SurfaceOperators& operators)
    : factor_(factor_free_block(grounded(free_block(operators.laplacian, region), region), region)),
      order_(row_order(region, factor_.order())) {
  const Triangles& t = mesh.triangles;
  for (int j = 0; j < mesh.triangle_count(); ++j)
    if (region.row[t(j, 0)] >= 0 || region.row[t(j, 1)] >= 0 || region.row[t(j, 2)] >= 0)
      active_.push_back(j);

  rows_ = rest_divergence_ = Rows::Zero(order_.free_count + 1, 4);
  // Summed over the triangles as the methods do, so that both cancel to the last digits.
  const Positions flux = corner_divergence(operators.metric, mesh.positions, t);
  for (int j : active_)
    for (int k = 0; k < 3; ++k)
      rest_divergence_.row(order_.target_of_vertex(t(j, k))).head<3>() +=
          flux.row(3 * Index(j) + k);

  for (int r = order_.free_count; r < order_.fixed_begin; ++r)
    for (SparseMatrix::InnerIterator it(operators.laplacian, order_.vertex_of_row[r]); it; ++it)
      if (region.row[it.row()] >= 0)
        pulls_.push_back({order_.row_of_vertex[it.row()], r, it.value()});
}

double* PoissonSystem::start(const Rows& offsets) {
  rows_ = -rest_divergence_;
  subtract_pulls(offsets);
  return rows_.data();
}

void PoissonSystem::subtract_pulls(const Rows& offsets) {
  for (const Pull& pull : pulls_)
    rows_.row(pull.target_row) -= pull.weight * offsets.row(pull.handle_row);
}

void PoissonSystem::extend(Rows& values) {
  rows_.setZero();
  subtract_pulls(values);
  solve(values);
}

void PoissonSystem::solve(Rows& offsets) {
  factor_.solve_in_order(rows_.data(), space_, nullptr, [&](int begin, int end, const auto* x) {
    for (int r = begin; r < end; ++r, x += 4)
      for (int c = 0; c < 4; ++c) offsets(r, c) = x[c];
  });
}

double PoissonSystem::bytes() const {
  return factor_.bytes() +
         static_cast<double>((rows_.size() + rest_divergence_.size()) * Index(sizeof(double))) +
         static_cast<double>(pulls_.size() * sizeof(Pull) +
                             (2 * order_.vertex_of_row.size() + active_.size()) * sizeof(int));
}

}  // namespace dd
