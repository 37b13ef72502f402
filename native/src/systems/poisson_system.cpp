// SPDX-License-Identifier: GPL-3.0-or-later
#include "systems/poisson_system.h"

#include <algorithm>
#include <utility>

namespace dd {

namespace {

// Largest accepted errors of a single-precision solve, alone and with a step of iterative
// refinement, in diagonals of the mesh's bounding box. They are measured with the rest positions as
// the solution: handles rarely move farther than the box is large. A plane of 31,000 unknowns has
// 1e-6; lower limits make more meshes pay for refinement or double precision.
constexpr double kAcceptedSolveError = 3e-6, kAcceptedCorrectedError = 5e-7;

}  // namespace

void ground(SparseMatrix& block, const Region& region) {
  for (int v : region.grounds) block.coeffRef(region.row[v], region.row[v]) *= 2;
}

RowOrder row_order(const Region& region, const std::vector<int>& order_of_free) {
  RowOrder order;
  for (int r : order_of_free) order.vertex_of_row.push_back(region.free[r]);
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

PoissonSystem::PoissonSystem(const Mesh& mesh, const Region& region,
                             const SurfaceOperators& operators, SparseMatrix block,
                             BlockOptions options)
    : pool_(*options.pool) {
  ground(block, region);
  factor_ = std::make_unique<SparseCholesky>(factor_free_block(block, region, options));
  rows_ = RightHandSideLayout(factor_->symbolic());
  order_ = row_order(region, factor_->order());
  find_active_triangles(operators.triangles);

  find_rims(operators.triangles);
  right_ = Rows::Zero(rim_begin() + Index(rims_.size() + rim_of_slot_.size()), 4);
  find_couplings(region, operators.laplacian);
  if (options.precision == Precision::single)
    choose_precision(mesh, region, block, std::move(options));
  sum_rest_divergence(mesh, operators);
}

void PoissonSystem::find_couplings(const Region& region, const SparseMatrix& laplacian) {
  for (int r = order_.free_count; r < order_.fixed_begin; ++r)
    for (SparseMatrix::InnerIterator it(laplacian, order_.vertex_of_row[r]); it; ++it)
      if (region.row[it.row()] >= 0)
        couplings_.push_back({order_.row_of_vertex[it.row()], r, it.value()});
  std::sort(couplings_.begin(), couplings_.end(),
            [](const Coupling& a, const Coupling& b) { return a.free_row < b.free_row; });
  for (int section = 0; section <= active_.sections(); ++section) {
    const int row = rows_.begin(section);
    coupling_begin_.push_back(static_cast<int>(
        std::partition_point(couplings_.begin(), couplings_.end(),
                             [&](const Coupling& coupling) { return coupling.free_row < row; }) -
        couplings_.begin()));
  }
}

void PoissonSystem::choose_precision(const Mesh& mesh, const Region& region,
                                     const SparseMatrix& block, BlockOptions options) {
  // Test solution: the rest positions, as large and as smooth as a frame's solution.
  Rows smooth(order_.free_count, 4);
  for (int r = 0; r < order_.free_count; ++r)
    smooth.row(r) << mesh.positions.row(order_.vertex_of_row[r]), 0;
  Rows in_block_order(smooth.rows(), 4);
  for (Index k = 0; k < smooth.rows(); ++k) in_block_order.row(factor_->order()[k]) = smooth.row(k);
  const Rows right = block * in_block_order;
  if (!(solving_error(right, smooth) > kAcceptedSolveError)) return;
  laplacian_ = factor_->in_order(block);
  correction_steps_ = 1;
  if (solving_error(right, smooth) < kAcceptedCorrectedError) return;
  correction_steps_ = 0;
  laplacian_.resize(0, 0);
  const Progress progress = options.progress;
  options.precision = Precision::full;
  options.symbolic = factor_->shared_symbolic();
  options.progress = within(progress, 1, 1);  // this stage was reported before
  factor_ = std::make_unique<SparseCholesky>(factor_free_block(block, region, options));
}

void PoissonSystem::sum_rest_divergence(const Mesh& mesh, const SurfaceOperators& operators) {
  // Summed triangle by triangle like the sources of gradients, so that at rest the two cancel to
  // the last digits.
  rest_divergence_ = Rows::Zero(right_.rows(), 4);
  run_tasks(&pool_, active_.sections(), [&](int section) {
    for (int i = active_.begin[section]; i < active_.begin[section + 1]; ++i) {
      const int j = active_.triangles[i];
      const Eigen::Matrix3d flux =
          corner_divergences(operators.metric, mesh.positions, operators.triangles, j);
      for (int k = 0; k < 3; ++k)
        rest_divergence_.row(right_hand_side_row(section, operators.triangles(j, k))).head<3>() +=
            flux.col(k).transpose();
    }
  });
}

void PoissonSystem::find_active_triangles(const Triangles& t) {
  // A triangle belongs to the section of its lowest row and is sorted by that row, for locality of
  // memory.
  std::vector<int> lowest(static_cast<size_t>(t.rows()));
  for (int j = 0; j < static_cast<int>(t.rows()); ++j) {
    lowest[j] = std::min({order_.row_of_vertex[t(j, 0)], order_.row_of_vertex[t(j, 1)],
                          order_.row_of_vertex[t(j, 2)]});
    if (lowest[j] < order_.free_count) active_.triangles.push_back(j);
  }
  std::sort(active_.triangles.begin(), active_.triangles.end(), [&](int a, int b) {
    return lowest[a] < lowest[b] || (lowest[a] == lowest[b] && a < b);
  });
  for (int section = 0; section <= rows_.sections(); ++section)
    active_.begin.push_back(static_cast<int>(
        std::partition_point(active_.triangles.begin(), active_.triangles.end(),
                             [&](int j) { return lowest[j] < rows_.begin(section); }) -
        active_.triangles.begin()));
}

void PoissonSystem::find_rims(const Triangles& t) {
  std::vector<int> found;  // rows
  const auto add = [&](int j) {
    for (int k = 0; k < 3; ++k) {
      const int row = order_.row_of_vertex[t(j, k)];
      if (row >= order_.free_count) found.push_back(row);
    }
  };
  const auto sort = [&] {
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
  };
  for (int j : active_.triangles) add(j);
  sort();
  rims_ = found;
  for (int section = 0; section < active_.sections(); ++section) {
    rim_slot_begin_.push_back(static_cast<int>(rim_of_slot_.size()));
    found.clear();
    for (int i = active_.begin[section]; i < active_.begin[section + 1]; ++i)
      add(active_.triangles[i]);
    sort();
    for (int row : found) rim_of_slot_.push_back(rim_of(row));
  }
  rim_slot_begin_.push_back(static_cast<int>(rim_of_slot_.size()));
}

int PoissonSystem::right_hand_side_row(int section, int vertex) const {
  const int row = order_.row_of_vertex[vertex];
  if (row < order_.free_count) return rows_.row_for(section, row);
  const auto slots = rim_of_slot_.begin();
  const auto slot = std::lower_bound(slots + rim_slot_begin_[section],
                                     slots + rim_slot_begin_[section + 1], rim_of(row));
  return rim_begin() + static_cast<int>(rims_.size()) + static_cast<int>(slot - slots);
}

void PoissonSystem::clear(int section, const Rows& at_rest) {
  const auto clear_rows = [&](Index begin, Index count) {
    right_.middleRows(begin, count) = -at_rest.middleRows(begin, count);
  };
  rows_.each_range(section, clear_rows);
  right_.row(rows_.discard_row(section)).setZero();
  clear_rows(rim_begin() + Index(rims_.size()) + rim_slot_begin_[section],
             rim_slot_begin_[section + 1] - rim_slot_begin_[section]);
}

const Rows& PoissonSystem::gather_rims() {
  const Index count = static_cast<Index>(rims_.size()), slots = rim_begin() + count;
  right_.middleRows(rim_begin(), count).setZero();
  for (size_t k = 0; k < rim_of_slot_.size(); ++k)
    right_.row(rim_begin() + rim_of_slot_[k]) += right_.row(slots + Index(k));
  return right_;
}

void PoissonSystem::start(int section, const Rows& at_rest, const Rows& offsets) {
  clear(section, at_rest);
  for (int i = coupling_begin_[section]; i < coupling_begin_[section + 1]; ++i)
    right_.row(couplings_[i].free_row) -=
        couplings_[i].weight * offsets.row(couplings_[i].handle_row);
}

void PoissonSystem::correct_residual(Rows& offsets) {
  rows_.gather_slots(right_);
  residual_.resize(right_.rows(), 4);
  residual_.bottomRows(right_.rows() - order_.free_count).setZero();
  pool_.parallel_for(order_.free_count, kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r) {
      Eigen::RowVector4d row = right_.row(r);
      for (decltype(laplacian_)::InnerIterator it(laplacian_, r); it; ++it)
        row -= it.value() * offsets.row(it.col());
      residual_.row(r) = row;
    }
  });
  factor_->solve_in_order(
      residual_.data(), scratch_, &pool_, [](int) {},
      [&](int begin, int end, const auto* x) {
        for (double* out = offsets.data() + 4 * Index(begin); begin < end; ++begin)
          for (int c = 0; c < 4; ++c) *out++ += *x++;
      });
}

double PoissonSystem::solving_error(const Rows& right, const Rows& solution) {
  right_.setZero();
  for (int k = 0; k < order_.free_count; ++k) right_.row(k) = right.row(factor_->order()[k]);
  Rows solved(order_.free_count, 4);
  factor_->solve_in_order(right_.data(), scratch_, &pool_, [](int) {}, towards(solved, 1));
  for (int step = 0; step < correction_steps_; ++step) correct_residual(solved);
  return (solved - solution).cwiseAbs().maxCoeff();
}

void PoissonSystem::extend(Rows& values) {
  const Rows nothing = Rows::Zero(right_.rows(), 4);
  solve(nothing, [](int, double*) {}, values);
}

void PoissonSystem::solve_free(Rows& rows) {
  right_.topRows(order_.free_count) = rows;
  right_.middleRows(order_.free_count, rim_begin() - order_.free_count).setZero();
  factor_->solve_in_order(
      right_.data(), scratch_, &pool_, [](int) {},
      [&](int begin, int end, const auto* x) {
        std::copy(x, x + 4 * Index(end - begin), rows.data() + 4 * Index(begin));
      },
      Columns::four);
}

double PoissonSystem::bytes() const {
  const size_t ints = 2 * order_.vertex_of_row.size() + active_.triangles.size() + rims_.size() +
                      rim_of_slot_.size();
  return factor_->bytes() + rows_.bytes() +
         static_cast<double>(
             (right_.size() + rest_divergence_.size() + residual_.size() + before_.size()) *
             Index(sizeof(double))) +
         static_cast<double>(laplacian_.nonZeros()) * (sizeof(double) + sizeof(int)) +
         static_cast<double>(couplings_.size() * sizeof(Coupling) + ints * sizeof(int) +
                             scratch_.single.size() * sizeof(float) +
                             scratch_.full.size() * sizeof(double));
}

}  // namespace dd
