// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/mixed_bilaplacian.h"

#include <algorithm>

#include "systems/free_block.h"

namespace dd {

namespace {

// The norm of the residual at the end, in that of the preconditioner, as a fraction of the first.
// Measured: the base is then within 3e-6 of the box of that by K's factor, as exact as a solve of L
// in single precision is.
constexpr double kConverged = 5e-6;
// Safety: at most so many iterations. Measured: 6 to 11.
constexpr int kMostIterations = 40;

using Sums = Eigen::Array<double, 1, 4>;

Sums dot(const Rows& a, const Rows& b) { return (a.array() * b.array()).colwise().sum(); }

/// a / b, 0 where b is.
Sums ratio(const Sums& a, const Sums& b) { return (b != 0).select(a / b, 0); }

std::vector<int> rim_of(const FactoredSurface& surface) {
  std::vector<int> rim;
  rim.reserve(surface.poisson->rims().size());
  for (int row : surface.poisson->rims()) rim.push_back(surface.order().vertex_of_row[size_t(row)]);
  std::sort(rim.begin(), rim.end());
  return rim;
}

/// The entries of L between free vertices, whose rows these are, and the given ones, a column each;
/// −1: it has no column in L.
SparseMatrix coupling_of(const SparseMatrix& laplacian, const std::vector<int>& row_of_free,
                         const std::vector<int>& columns, int rows) {
  std::vector<Eigen::Triplet<double>> entries;
  for (size_t i = 0; i < columns.size(); ++i) {
    if (columns[i] < 0) continue;
    for (SparseMatrix::InnerIterator it(laplacian, columns[i]); it; ++it)
      if (row_of_free[size_t(it.row())] >= 0)
        entries.emplace_back(row_of_free[size_t(it.row())], static_cast<int>(i), it.value());
  }
  SparseMatrix coupling(rows, static_cast<Index>(columns.size()));
  coupling.setFromTriplets(entries.begin(), entries.end());
  return coupling;
}

/// The rows in the surface's order of its free vertices, by vertex; −1 of the others.
std::vector<int> free_rows_of(const FactoredSurface& surface) {
  std::vector<int> rows(surface.region.row.size(), -1);
  for (int v : surface.region.free) rows[size_t(v)] = surface.order().row_of_vertex[size_t(v)];
  return rows;
}

}  // namespace

MixedBilaplacian::CoarsePlate::CoarsePlate(const FactoredSurface& surface, const CoarseMesh& mesh,
                                           const std::vector<int>& rim)
    : region(region_of_roles(mesh.roles, surface.region.handle_count)),
      operators(
          surface_operators(mesh.mesh.positions, mesh.mesh.triangles, Triangulation::delaunay)),
      masses(static_cast<Index>(rim.size())) {
  operators.masses = mesh.sums(surface.operators.masses);
  BlockOptions options;
  options.pool = &surface.poisson->pool();
  const Dissection dissection = free_dissection(free_block(operators.laplacian, region), region,
                                                mesh.mesh.positions, options.pool);
  options.dissection = &dissection;
  energy = std::make_unique<PolyharmonicSystem>(operators, region, Smoothness::thin_plate, options);
  std::vector<int> own;  // vertex of the coarse mesh; −1: only flipped edges lead to it
  for (size_t i = 0; i < rim.size(); ++i) {
    const int v = mesh.of_vertex[size_t(rim[i])];
    own.push_back(v >= 0 && mesh.vertices[size_t(v)] == rim[i] ? v : -1);
    masses[Index(i)] =
        own.back() >= 0 ? operators.masses[own.back()] : surface.operators.masses[rim[i]];
  }
  coupling = coupling_of(operators.laplacian, region.row, own, region.free_count());
}

Rows MixedBilaplacian::CoarsePlate::operator()(const Rows& residual, ThreadPool& pool) {
  Rows result = masses.cwiseInverse().asDiagonal() * residual;
  const Rows right = coupling * result;
  energy->factor()->solve_rows([&](int row) -> Eigen::RowVector4d { return right.row(row); },
                               solution, scratch, &pool);
  const Rows curvature = coupling.transpose() * solution;
  result -= masses.cwiseInverse().asDiagonal() * curvature;
  return result;
}

MixedBilaplacian::MixedBilaplacian(const FactoredSurface& surface, const CoarseMesh& coarse)
    : surface_(surface),
      rim_(rim_of(surface)),
      coupling_(coupling_of(surface.operators.laplacian, free_rows_of(surface), rim_,
                            surface.region.free_count())),
      coarse_(surface, coarse, rim_),
      force_(surface.region.free_count(), 4) {}

void MixedBilaplacian::take_rim_values(const Rows& lambda, Rows& right) const {
  right.setZero(coupling_.rows(), 4);
  for (Index i = 0; i < coupling_.cols(); ++i)
    for (SparseMatrix::InnerIterator it(coupling_, i); it; ++it)
      right.row(it.row()) -= it.value() * lambda.row(i);
}

Rows MixedBilaplacian::flux(const Rows& x) const { return coupling_.transpose() * x; }

void MixedBilaplacian::multiply_by_masses(Rows& rows) const {
  const std::vector<int>& vertices = surface_.order().vertex_of_row;
  surface_.poisson->pool().parallel_for(rows.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r)
      rows.row(r) *= surface_.operators.masses[vertices[size_t(r)]];
  });
}

Rows MixedBilaplacian::product(const Rows& lambda) {
  take_rim_values(lambda, work_);
  surface_.poisson->solve_free(work_);
  multiply_by_masses(work_);
  surface_.poisson->solve_free(work_);
  Rows result(lambda.rows(), 4);
  for (size_t i = 0; i < rim_.size(); ++i)
    result.row(Index(i)) = surface_.operators.masses[rim_[i]] * lambda.row(Index(i));
  return result - flux(work_);
}

const Rows& MixedBilaplacian::extend(const Rows& values) {
  const Region& region = surface_.region;
  PoissonSystem& poisson = *surface_.poisson;
  Rows rim_values(static_cast<Index>(rim_.size()), 4);
  for (size_t i = 0; i < rim_.size(); ++i) rim_values.row(Index(i)) = values.row(rim_[i]);
  take_rim_values(rim_values, force_);
  work_ = force_;
  poisson.solve_free(work_);
  Rows residual = flux(work_);
  for (size_t i = 0; i < rim_.size(); ++i)
    for (SparseMatrix::InnerIterator it(surface_.operators.laplacian, rim_[i]); it; ++it)
      if (region.row[it.row()] < 0) residual.row(Index(i)) += it.value() * values.row(it.row());

  Rows lambda = Rows::Zero(residual.rows(), 4), direction = lambda;
  Sums before = Sums::Zero(), first = Sums::Zero();
  for (int iteration = 0;; ++iteration) {
    const Rows preconditioned = coarse_(residual, poisson.pool());
    const Sums now = dot(residual, preconditioned);
    if (iteration == 0) first = now;
    if ((now <= kConverged * kConverged * first).all()) break;
    if (iteration == kMostIterations || !now.isFinite().all())
      throw UnsolvableSurface(region.free.front());
    direction.array().rowwise() *= ratio(now, before);
    direction += preconditioned;
    const Rows image = product(direction);
    const Sums step = ratio(now, dot(direction, image));
    lambda.array() += direction.array().rowwise() * step;
    residual.array() -= image.array().rowwise() * step;
    before = now;
  }

  take_rim_values(lambda, work_);
  poisson.solve_free(work_);
  multiply_by_masses(work_);
  work_ += force_;
  poisson.solve_free(work_);
  result_.resize(region.free_count(), 4);
  for (int r = 0; r < region.free_count(); ++r)
    result_.row(r) = work_.row(surface_.order().row_of_vertex[region.free[r]]);
  return result_;
}

}  // namespace dd
