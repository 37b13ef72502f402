// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/handle_extension.h"

#include <algorithm>

#include "base/mixed_bilaplacian.h"

namespace dd {

namespace {

/// The coordinates of each of Region::handle_vertices, a row each; zero for those of other handles.
SparseMatrix values_at_handles(const HandleCoordinates& coordinates, const Region& region,
                               const Positions& positions) {
  std::vector<Eigen::Triplet<double>> entries;
  for (size_t i = 0; i < region.handle_vertices.size(); ++i) {
    const int v = region.handle_vertices[i], h = region.role[v];
    const auto values = coordinates.at(positions.row(v), h);
    for (int k = 0; k < coordinates.count(h); ++k)
      entries.emplace_back(static_cast<int>(i), coordinates.begin(h) + k, values[k]);
  }
  SparseMatrix result(Index(region.handle_vertices.size()), coordinates.count());
  result.setFromTriplets(entries.begin(), entries.end());
  return result;
}

/// Values at Region::handle_vertices as rows of all vertices.
void place(const Rows& values, const Region& region, Rows& all) {
  for (Index i = 0; i < values.rows(); ++i)
    all.row(region.handle_vertices[size_t(i)]) = values.row(i);
}

}  // namespace

HandleExtension::HandleExtension(const HandleCoordinates& coordinates, const Region& region,
                                 const Positions& positions, const RowOrder& order,
                                 ThreadPool* pool)
    : coordinates_(coordinates),
      coordinate_values_(values_at_handles(coordinates, region, positions)),
      pool_(pool) {
  for (int v : region.free) row_of_free_.push_back(order.row_of_vertex[v]);
}

HandleExtension::HandleExtension(MixedBilaplacian& bending, const HandleCoordinates& coordinates,
                                 const Region& region, const Positions& positions,
                                 const RowOrder& order, const HandleExtensionOptions& options)
    : HandleExtension(coordinates, region, positions, order, options.pool) {
  Rows all = Rows::Zero(positions.rows(), 4);
  basis_functions_ = extended(
      [&](const Rows& values) -> const Rows& {
        place(values, region, all);
        return bending.extend(all);
      },
      options.progress);
}

HandleExtension::HandleExtension(const PolyharmonicSystem& bending,
                                 const HandleCoordinates& coordinates, const Region& region,
                                 const Positions& positions, const RowOrder& order,
                                 const HandleExtensionOptions& options)
    : HandleExtension(coordinates, region, positions, order, options.pool) {
  const int64_t entries = int64_t{coordinates.count()} * region.free_count();
  // Break-even at half the factor's entries: a frame reads W once and the factor up to twice, but
  // the bind would have to solve for each column of W.
  const bool keep = options.kept == KeptOfEnergy::factor ||
                    (options.kept == KeptOfEnergy::cheaper && options.single_solve &&
                     2 * entries > bending.factor()->factor().entries());
  std::unique_ptr<HandleSolve> solve;
  if (keep || options.single_solve) solve = std::make_unique<HandleSolve>(bending, region, pool_);
  if (keep) {
    solve->prepare_frames(coordinate_values_, row_of_free_, options.precision);
    solve_ = std::move(solve);
    return;
  }
  if (solve) {
    basis_functions_ = extended_by(*solve, options.progress);
    return;
  }
  PolyharmonicSystem::Scratch space;
  space.values = Rows::Zero(positions.rows(), 4);
  basis_functions_ = extended(
      [&](const Rows& values) -> const Rows& {
        place(values, region, space.values);
        return bending.extend(space);
      },
      options.progress);
}

template <class Extend>
RowMatrix HandleExtension::extended(const Extend& extend,
                                    const std::function<void(double)>& progress) const {
  const Index count = coordinates_.count();
  const int free_count = static_cast<int>(row_of_free_.size());
  RowMatrix result(free_count, count);
  std::vector<int> free_of_row(row_of_free_.size());
  for (int r = 0; r < free_count; ++r) free_of_row[row_of_free_[r]] = r;
  Rows values = Rows::Zero(coordinate_values_.rows(), 4);
  for (Index first = 0; first < count; first += 4) {
    const Index width = std::min<Index>(4, count - first);
    values.setZero();
    values.leftCols(width) = coordinate_values_.middleCols(first, width);
    const Rows& some = extend(values);
    pool_->parallel_for(free_count, kLeastRange, [&](int64_t begin, int64_t end) {
      for (int64_t row = begin; row < end; ++row)
        for (Index c = 0; c < width; ++c)
          result(row, first + c) = some(free_of_row[size_t(row)], c);
    });
    if (progress) progress(static_cast<double>(first + width) / static_cast<double>(count));
  }
  return result;
}

RowMatrix HandleExtension::extended_by(const HandleSolve& solve,
                                       const std::function<void(double)>& progress) const {
  HandleSolve::Scratch space;
  return extended([&](const Rows& values) -> const Rows& { return solve.extend(values, space); },
                  progress);
}

const RowMatrix& HandleExtension::basis_functions(RowMatrix& space) const {
  if (!solve_) return basis_functions_;
  space = extended_by(*solve_, {});
  return space;
}

void HandleExtension::displace(const RowMatrix& coefficients, const Rows& rest, Rows& out) const {
  const RowMatrix reduced = coordinates_.reduced(coefficients);
  if (solve_) {
    solve_->add_extended(reduced, rest, out);
    return;
  }
  pool_->parallel_for(basis_functions_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    kernels().blend(static_cast<int>(end - begin), static_cast<int>(basis_functions_.cols()),
                    basis_functions_.row(begin).data(), reduced.data(), rest.row(begin).data(),
                    out.row(begin).data());
  });
}

double HandleExtension::bytes() const {
  return static_cast<double>(basis_functions_.size()) * sizeof(double) +
         static_cast<double>(coordinate_values_.nonZeros()) * (sizeof(double) + sizeof(int)) +
         static_cast<double>(row_of_free_.size() * sizeof(int)) + (solve_ ? solve_->bytes() : 0);
}

}  // namespace dd
