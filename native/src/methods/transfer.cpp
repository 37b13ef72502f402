// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer.h"

#include <algorithm>

#include "../bending_system.h"

namespace dd {

namespace {

std::vector<int> triangles_with_free_corner(const Mesh& mesh, const Region& region) {
  std::vector<int> active;
  for (int j = 0; j < mesh.triangle_count(); ++j)
    for (int k = 0; k < 3; ++k)
      if (region.row[mesh.triangles(j, k)] >= 0) {
        active.push_back(j);
        break;
      }
  return active;
}

}  // namespace

Transfer::Transfer(const Input& in)
    : poisson_(factor_free_block(free_block(in.operators.laplacian, in.region), in.region)) {
  const Region& region = in.region;
  const Triangles& t = in.mesh.triangles;
  const int free_rows = region.free_count(), spare_row = free_rows;

  vertex_of_row_.reserve(static_cast<size_t>(free_rows));
  for (int r : poisson_.order()) vertex_of_row_.push_back(region.free[r]);

  // Rows of the base: the free ones as in the factor, then every other vertex that is read.
  std::vector<int> vertex_of_base_row = vertex_of_row_;
  std::vector<int> base_row(region.role.size(), -1), target_row(region.role.size(), spare_row);
  for (int r = 0; r < free_rows; ++r)
    base_row[vertex_of_row_[r]] = target_row[vertex_of_row_[r]] = r;
  const std::vector<int> active = triangles_with_free_corner(in.mesh, region);
  const GradientSources sources =
      gradient_sources(in.base, t, bounding_box_diagonal(in.mesh.positions));
  const Positions flux = corner_divergence(in.operators.metric, in.mesh.positions, t);
  rest_divergence_ = Rows::Zero(free_rows + 1, 4);
  for (int j : active) {
    const int source = sources.of_triangle[j];
    borrowed_count_ += source != j;
    if (source < 0) continue;  // S_j = I: what it would add is what it would take away
    for (int k = 0; k < 3; ++k) {
      rest_divergence_.row(target_row[t(j, k)]).head<3>() += flux.row(3 * Index(j) + k);
      int& row = base_row[t(source, k)];
      if (row >= 0) continue;
      row = static_cast<int>(vertex_of_base_row.size());
      vertex_of_base_row.push_back(t(source, k));
    }
  }
  pass_ = GradientPass(in.base, t, flux, active, sources, base_row, target_row, spare_row);

  const Index base_rows = static_cast<Index>(vertex_of_base_row.size());
  rest_base_ = Rows::Zero(base_rows, 4);
  for (Index r = 0; r < base_rows; ++r)
    rest_base_.row(r).head<3>() = in.base.row(vertex_of_base_row[r]);
  base_ = rest_base_;
  rows_ = Rows::Zero(free_rows + 1, 4);

  weights_.resize(free_rows, in.basis.weights.cols());
  for (int r = 0; r < free_rows; ++r) weights_.row(r) = in.basis.weights.row(poisson_.order()[r]);

  for (int k = 0; k < static_cast<int>(region.handle_vertices.size()); ++k) {
    const int v = region.handle_vertices[k];
    if (base_row[v] >= 0) handle_rows_.push_back({base_row[v], k});
    for (SparseMatrix::InnerIterator it(in.operators.laplacian, v); it; ++it)
      if (region.row[it.row()] >= 0) boundary_.push_back({target_row[it.row()], k, it.value()});
  }
}

void Transfer::update(const double* coefficients, const double* handle_offsets,
                      bool rotation_only) {
  using Row = Eigen::Map<const Eigen::RowVector4d>;
  kernels().blend(free_count(), static_cast<int>(weights_.cols()), weights_.data(), coefficients,
                  rest_base_.data(), base_.data());
  for (const HandleRow& h : handle_rows_)
    base_.row(h.base_row) =
        rest_base_.row(h.base_row) + Row(handle_offsets + 4 * Index(h.handle_vertex));

  rows_ = -rest_divergence_;
  for (const BoundaryEntry& e : boundary_)
    rows_.row(e.row) -= e.weight * Row(handle_offsets + 4 * Index(e.handle_vertex));
  pass_.add_to(rows_.data(), base_.data(), rotation_only);
  poisson_.solve_in_order(rows_.data());
}

double Transfer::bytes() const {
  const auto doubles = weights_.size() + rest_base_.size() + base_.size() + rows_.size() +
                       rest_divergence_.size() + poisson_.size();
  return static_cast<double>(doubles) * sizeof(double) + pass_.bytes() +
         static_cast<double>(poisson_.nonzeros()) * (sizeof(double) + sizeof(int)) +
         static_cast<double>(boundary_.size() * sizeof(BoundaryEntry));
}

}  // namespace dd
