// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/coarse/coarse_clamps.h"

#include <Eigen/Geometry>
#include <cmath>
#include <future>

#include "support/run_async.h"

namespace dd {

namespace {

// Increase of the coarse spacing per distance from the rims. Measured: δ is then within 5e-5 of the
// box of that on the surface itself at 99% of the vertices, and within 4e-4 at all; with 0.1, 7e-5
// and 7e-4. Lower values keep more vertices.
constexpr double kSlowGrowth = 0.05;
// Largest area of the surface, as a multiple of that of the coarse one. Relief that is finer than
// the coarse vertices changes how flux spreads, as in raw scans. Measured: at 1.05 errors are
// within 2e-4 of the box at 99% of the vertices, at 1.15 within 1.5e-3.
constexpr double kMostRelief = 1.05;
// Largest fraction of the free vertices that the coarse surface may have. Break-even: with two
// fifths its factors take the memory that is saved.
constexpr double kMostCoarse = 0.35;

/// Half of the mean gradient at each active vertex of a function of the active vertices, by its
/// axis: ½ Σ_j A_j ∇φ_j / Σ_j A_j over the triangles around it.
Eigen::SparseMatrix<double, Eigen::RowMajor> half_gradients(const FactoredSurface& surface) {
  const Triangles& t = surface.mesh.triangles;
  const PoissonSystem& poisson = *surface.poisson;
  const Index count = poisson.active_vertex_count();
  std::vector<int> index(size_t(surface.mesh.vertex_count()));
  for (int v = 0; v < surface.mesh.vertex_count(); ++v)
    index[size_t(v)] = poisson.active_index_of_vertex(v);
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::VectorXd areas = Eigen::VectorXd::Zero(count);
  for (Index j = 0; j < t.rows(); ++j) {
    Eigen::Matrix3d p;
    for (int k = 0; k < 3; ++k) p.col(k) = surface.mesh.positions.row(t(j, k));
    const Eigen::Vector3d normal = (p.col(1) - p.col(0)).cross(p.col(2) - p.col(0));
    const double square = normal.squaredNorm();
    if (!(square > 0)) continue;
    const double area = std::sqrt(square);  // twice the area
    for (int at = 0; at < 3; ++at) {
      const int row = index[size_t(t(j, at))];
      if (row < 0) continue;
      areas[row] += area;
      for (int k = 0; k < 3; ++k) {
        const int column = index[size_t(t(j, k))];
        if (column < 0) continue;  // inside of what is constrained: δ is zero
        const Eigen::Vector3d gradient =
            normal.cross(p.col((k + 2) % 3) - p.col((k + 1) % 3)) / square;
        for (int axis = 0; axis < 3; ++axis)
          entries.emplace_back(3 * row + axis, column, area * gradient[axis]);
      }
    }
  }
  Eigen::SparseMatrix<double, Eigen::RowMajor> result(3 * count, count);
  result.setFromTriplets(entries.begin(), entries.end());
  for (Index row = 0; row < result.rows(); ++row)
    for (decltype(result)::InnerIterator it(result, row); it; ++it)
      it.valueRef() *= 0.5 / areas[row / 3];
  return result;
}

}  // namespace

std::unique_ptr<CoarseClamps> CoarseClamps::make(FactoredSurface& fine, double length) {
  std::future<Eigen::VectorXd> squares = run_async(fine.poisson->pool().count(), [&] {
    return clamped_squares(fine.mesh, fine.operators, *fine.poisson, length);
  });
  std::unique_ptr<CoarseSurface> coarse =
      CoarseSurface::make(fine, kMaxSpacing * fine.active_size, kSlowGrowth);
  if (!coarse) return nullptr;
  const CoarseMesh& contraction = coarse->contraction();
  if (contraction.free_count > kMostCoarse * fine.region.free_count() ||
      contraction.sums(fine.operators.masses).sum() >
          kMostRelief * coarse->surface().operators.masses.sum())
    return nullptr;
  const Eigen::VectorXd of_coarse = squares.get()(coarse->vertices());
  try {
    return std::unique_ptr<CoarseClamps>(
        new CoarseClamps(fine, std::move(coarse), length, of_coarse));
  } catch (const UnsolvableSurface&) {
    return nullptr;  // an error of the coarse surface only, which names its own vertices
  }
}

CoarseClamps::CoarseClamps(FactoredSurface& fine, std::unique_ptr<CoarseSurface> coarse,
                           double length, const Eigen::VectorXd& squares)
    : fine_(fine),
      coarse_(std::move(coarse)),
      clamped_(coarse_->surface().mesh, coarse_->surface().region, coarse_->surface().operators,
               *coarse_->surface().poisson, *coarse_->surface().dissection, length, squares,
               coarse_->contraction().sums(fine.operators.masses)),
      rims_(rim_laplacian(fine.operators, *fine.poisson)),
      gradients_(half_gradients(coarse_->surface())) {
  const PoissonSystem& poisson = *coarse_->surface().poisson;
  for (int row : poisson.rims()) {
    const int v = coarse_->vertices()[size_t(poisson.order().vertex_of_row[size_t(row)])];
    const int index = fine.poisson->active_index_of_vertex(v);
    fine_rim_.push_back(index < 0 ? -1 : index - fine.order().free_count);
  }
  const std::vector<CoarseSurface::Stencil> all = coarse_->stencils(fine);
  stencils_.resize(size_t(fine.order().free_count));
  for (size_t i = 0; i < stencils_.size(); ++i)
    for (size_t k = 0; k < 3; ++k) {
      stencils_[i].node[k] = all[i].active_index[k];
      stencils_[i].weight[k] = static_cast<float>(all[i].weight[k]);
    }
  nodes_.resize(size_t(poisson.active_vertex_count()));
}

void CoarseClamps::solve(const FluxSource& source, double weight, Rows& offsets) {
  PoissonSystem& poisson = *fine_.poisson;
  poisson.solve(
      source.at_rest(), [&](int section, double* rows) { source.add(section, rows); }, offsets);
  if (weight == 0) return;
  mismatch_ = poisson.rim_divergence().middleRows(poisson.rim_begin(), rims_.rows());
  mismatch_ -= rims_ * offsets;
  coarse_mismatch_.setZero(static_cast<Index>(fine_rim_.size()), 4);
  for (size_t i = 0; i < fine_rim_.size(); ++i)
    if (fine_rim_[i] >= 0) coarse_mismatch_.row(Index(i)) = mismatch_.row(fine_rim_[i]);
  clamped_.displace(coarse_mismatch_, displacement_);
  take_nodes();
  poisson.pool().parallel_for(
      static_cast<int64_t>(stencils_.size()), kLeastRange, [&](int64_t begin, int64_t end) {
        for (int64_t r = begin; r < end; ++r) {
          const Stencil& stencil = stencils_[size_t(r)];
          Node mean = stencil.weight[0] * nodes_[size_t(stencil.node[0])];
          mean += stencil.weight[1] * nodes_[size_t(stencil.node[1])];
          mean += stencil.weight[2] * nodes_[size_t(stencil.node[2])];
          const Eigen::RowVector4f at = fine_.rest.row(r).cast<float>();
          const Eigen::Array4f moved =
              mean.col(0) + at[0] * mean.col(1) + at[1] * mean.col(2) + at[2] * mean.col(3);
          offsets.row(r).array() += weight * moved.transpose().cast<double>();
        }
      });
}

void CoarseClamps::take_nodes() {
  const FactoredSurface& surface = coarse_->surface();
  const PoissonSystem& poisson = *surface.poisson;
  Rows active(static_cast<Index>(nodes_.size()), 4);
  for (Index i = 0; i < active.rows(); ++i)
    active.row(i) = displacement_.row(poisson.active_row(static_cast<int>(i)));
  const Rows slopes = gradients_ * active;  // row 3i + axis
  for (size_t i = 0; i < nodes_.size(); ++i) {
    const auto slope = slopes.middleRows<3>(3 * Index(i));
    const auto at = surface.rest.row(poisson.active_row(static_cast<int>(i))).head<3>();
    nodes_[i].col(0) = (active.row(Index(i)) - at * slope).transpose().cast<float>();
    nodes_[i].rightCols<3>() = slope.transpose().cast<float>();
  }
}

double CoarseClamps::bytes() const {
  return coarse_->bytes() + clamped_.bytes() +
         static_cast<double>(rims_.nonZeros() + gradients_.nonZeros()) *
             (sizeof(double) + sizeof(int)) +
         static_cast<double>(stencils_.size() * sizeof(Stencil) + nodes_.size() * sizeof(Node) +
                             fine_rim_.size() * sizeof(int)) +
         static_cast<double>((mismatch_.size() + coarse_mismatch_.size() + displacement_.size()) *
                             Index(sizeof(double)));
}

}  // namespace dd
