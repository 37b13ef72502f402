// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/poisson_system.h"

#include <algorithm>

namespace dd {

namespace {

// Of the mesh's size, for a solution of that size. Handles rarely move further.
constexpr double kSingleIsEnough = 3e-6, kRefinedIsEnough = 5e-7;

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
void ground(SparseMatrix& block, const Region& region) {
  for (int v : region.grounds) block.coeffRef(region.row[v], region.row[v]) *= 2;
}

}  // namespace

PoissonSystem::PoissonSystem(const Mesh& mesh, const Region& region,
                             const SurfaceOperators& operators, SparseMatrix block,
                             BlockOptions options)
    : workers_(*options.workers) {
  ground(block, region);
  factor_ = std::make_unique<SparseCholesky>(factor_free_block(block, region, options));
  order_ = row_order(region, factor_->order());
  find_active_triangles(mesh);

  const int parts = active_.parts();
  right_ = Rows::Zero(factor_->elimination().slotted_size() + parts, 4);
  for (int r = order_.free_count; r < order_.fixed_begin; ++r)
    for (SparseMatrix::InnerIterator it(operators.laplacian, order_.vertex_of_row[r]); it; ++it)
      if (region.row[it.row()] >= 0)
        pulls_.push_back({order_.row_of_vertex[it.row()], r, it.value()});
  std::sort(pulls_.begin(), pulls_.end(),
            [](const Pull& a, const Pull& b) { return a.target_row < b.target_row; });
  for (int part = 0; part <= parts; ++part) {
    const int row = factor_->elimination().part_begin(part);
    pull_begin_.push_back(static_cast<int>(
        std::partition_point(pulls_.begin(), pulls_.end(),
                             [&](const Pull& pull) { return pull.target_row < row; }) -
        pulls_.begin()));
  }

  if (options.precision == Precision::single) {
    const Progress progress = options.progress;
    // Of a solution as large and as smooth as a frame's.
    Rows smooth(order_.free_count, 4);
    for (int r = 0; r < order_.free_count; ++r)
      smooth.row(r) << mesh.positions.row(order_.vertex_of_row[r]), 0;
    const auto in_block_order = [&](const Rows& rows) {
      Rows result(rows.rows(), 4);
      for (Index k = 0; k < rows.rows(); ++k) result.row(factor_->order()[k]) = rows.row(k);
      return result;
    };
    const Rows right = block * in_block_order(smooth);
    if (solving_error(right, smooth) > kSingleIsEnough) {
      const Eigen::PermutationMatrix<Eigen::Dynamic> to_factor_order(
          Eigen::Map<const Eigen::VectorXi>(factor_->elimination().place_of.data(), block.rows()));
      laplacian_ = block.twistedBy(to_factor_order);
      refinement_steps_ = 1;
      if (!(solving_error(right, smooth) < kRefinedIsEnough)) {
        refinement_steps_ = 0;
        laplacian_.resize(0, 0);
        options.precision = Precision::full;
        options.elimination = factor_->shared_elimination();
        options.progress = within(progress, 1, 1);  // it was told of this stage before
        factor_ = std::make_unique<SparseCholesky>(factor_free_block(block, region, options));
      }
    }
  }

  // Summed over the triangles as the methods do, so that both cancel to the last digits.
  const Positions flux = corner_divergence(operators.metric, mesh.positions, mesh.triangles);
  rest_divergence_ = Rows::Zero(right_.rows(), 4);
  for (int part = 0; part < parts; ++part)
    for (int i = active_.begin[part]; i < active_.begin[part + 1]; ++i)
      for (int k = 0; k < 3; ++k) {
        const int j = active_.triangles[i];
        rest_divergence_.row(target(part, mesh.triangles(j, k))).head<3>() +=
            flux.row(3 * Index(j) + k);
      }
}

void PoissonSystem::find_active_triangles(const Mesh& mesh) {
  const Elimination& e = factor_->elimination();
  const Triangles& t = mesh.triangles;
  // The lowest row of a triangle tells its part, and its place there: what is worked on together
  // lies together.
  std::vector<int> lowest(static_cast<size_t>(mesh.triangle_count()));
  for (int j = 0; j < mesh.triangle_count(); ++j) {
    lowest[j] = std::min({order_.row_of_vertex[t(j, 0)], order_.row_of_vertex[t(j, 1)],
                          order_.row_of_vertex[t(j, 2)]});
    if (lowest[j] < order_.free_count) active_.triangles.push_back(j);
  }
  std::stable_sort(active_.triangles.begin(), active_.triangles.end(),
                   [&](int a, int b) { return lowest[a] < lowest[b]; });
  for (int part = 0; part <= e.domain_count() + 1; ++part)
    active_.begin.push_back(static_cast<int>(
        std::partition_point(active_.triangles.begin(), active_.triangles.end(),
                             [&](int j) { return lowest[j] < e.part_begin(part); }) -
        active_.triangles.begin()));

  const int top = e.part_begin(e.domain_count());
  slot_of_top_.assign(static_cast<size_t>(e.domain_count()),
                      std::vector<int>(static_cast<size_t>(e.size() - top), -1));
  for (int d = 0; d < e.domain_count(); ++d)
    for (int k = e.slot_begin[d]; k < e.slot_begin[d + 1]; ++k)
      slot_of_top_[d][e.slot_target[k] - top] = e.size() + k;
}

int PoissonSystem::target(int part, int vertex) const {
  const Elimination& e = factor_->elimination();
  const int row = order_.row_of_vertex[vertex];
  if (row >= order_.free_count) return spare_target(part);
  const int top = e.part_begin(e.domain_count());
  return part == e.domain_count() || row < top ? row : slot_of_top_[part][row - top];
}

void PoissonSystem::start(int part, const Rows& at_rest, const Rows& offsets) {
  const Elimination& e = factor_->elimination();
  const auto copy = [&](int begin, int count) {
    right_.middleRows(begin, count) = -at_rest.middleRows(begin, count);
  };
  copy(e.part_begin(part), e.part_begin(part + 1) - e.part_begin(part));
  if (part < e.domain_count())
    copy(e.size() + e.slot_begin[part], e.slot_begin[part + 1] - e.slot_begin[part]);
  right_.row(e.slotted_size() + part).setZero();
  for (int i = pull_begin_[part]; i < pull_begin_[part + 1]; ++i)
    right_.row(pulls_[i].target_row) -= pulls_[i].weight * offsets.row(pulls_[i].handle_row);
}

void PoissonSystem::refine(Rows& offsets) {
  const Elimination& e = factor_->elimination();
  for (size_t k = 0; k < e.slot_target.size(); ++k) {
    const Index slot = e.size() + Index(k);
    right_.row(e.slot_target[k]) += right_.row(slot);
    right_.row(slot).setZero();
  }
  residual_.resize(right_.rows(), 4);
  residual_.bottomRows(right_.rows() - e.size()).setZero();
  workers_.over(e.size(), 1000, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r) {
      Eigen::RowVector4d row = right_.row(r);
      for (decltype(laplacian_)::InnerIterator it(laplacian_, r); it; ++it)
        row -= it.value() * offsets.row(it.col());
      residual_.row(r) = row;
    }
  });
  factor_->solve_in_order(
      residual_.data(), space_, &workers_, [](int) {},
      [&](int begin, int end, const auto* x) {
        for (double* out = offsets.data() + 4 * Index(begin); begin < end; ++begin)
          for (int c = 0; c < 4; ++c) *out++ += *x++;
      });
}

double PoissonSystem::solving_error(const Rows& right, const Rows& solution) {
  right_.setZero();
  for (int k = 0; k < order_.free_count; ++k) right_.row(k) = right.row(factor_->order()[k]);
  Rows solved(order_.free_count, 4);
  factor_->solve_in_order(
      right_.data(), space_, &workers_, [](int) {}, into(solved));
  for (int step = 0; step < refinement_steps_; ++step) refine(solved);
  return (solved - solution).cwiseAbs().maxCoeff();
}

void PoissonSystem::extend(Rows& values) {
  const Rows nothing = Rows::Zero(right_.rows(), 4);
  solve(
      nothing, [](int, double*) {}, values);
}

double PoissonSystem::bytes() const {
  size_t ints = 2 * order_.vertex_of_row.size() + active_.triangles.size();
  for (const std::vector<int>& slots : slot_of_top_) ints += slots.size();
  return factor_->bytes() +
         static_cast<double>((right_.size() + rest_divergence_.size() + residual_.size()) *
                             Index(sizeof(double))) +
         static_cast<double>(laplacian_.nonZeros()) * (sizeof(double) + sizeof(int)) +
         static_cast<double>(pulls_.size() * sizeof(Pull) + ints * sizeof(int) +
                             space_.single.size() * sizeof(float) +
                             space_.full.size() * sizeof(double));
}

}  // namespace dd
