// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/handle_extension.h"

#include <algorithm>

namespace dd {

namespace {

// Of W: what all need at once would take several times its memory.
constexpr Index kColumnsAtOnce = 16;

/// m×coordinates, rows as Region::handle_vertices.
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

/// Of all vertices, from those of the handles: zero elsewhere.
RowMatrix at_vertices(const RowMatrix& at_handles, const Region& region) {
  RowMatrix result = RowMatrix::Zero(Index(region.role.size()), at_handles.cols());
  for (size_t i = 0; i < region.handle_vertices.size(); ++i)
    result.row(region.handle_vertices[i]) = at_handles.row(Index(i));
  return result;
}

}  // namespace

HandleExtension::HandleExtension(const PolyharmonicSystem& bending,
                                 const HandleCoordinates& coordinates, const Region& region,
                                 const Positions& positions, const RowOrder& order,
                                 ThreadPool& pool, bool one_solve, KeptOfEnergy kept,
                                 const std::function<void(double)>& progress)
    : coordinates_(coordinates),
      values_(values_at_handles(coordinates, region, positions)),
      pool_(&pool) {
  for (int v : region.free) row_of_free_.push_back(order.row_of_vertex[v]);
  const int64_t entries = int64_t{coordinates.count()} * region.free_count();
  // A frame reads W once and the factor up to twice, but a bind solves for each column of W.
  const bool keep =
      kept == KeptOfEnergy::factor || (kept == KeptOfEnergy::cheaper && one_solve &&
                                       2 * entries > bending.factor()->factor().entries());
  std::unique_ptr<HandleSolve> solve;
  if (keep || one_solve) solve = std::make_unique<HandleSolve>(bending, region, &pool);
  if (keep) {
    solve->prepare_frames(values_, row_of_free_);
    solve_ = std::move(solve);
    return;
  }
  functions_ = extended(
      [&](const RowMatrix& values) {
        return solve ? solve->extend(values) : bending.extend(at_vertices(values, region));
      },
      progress);
}

template <class Extend>
RowMatrix HandleExtension::extended(const Extend& extend,
                                    const std::function<void(double)>& progress) const {
  const Index count = coordinates_.count();
  RowMatrix result(Index(row_of_free_.size()), count);
  for (Index first = 0; first < count; first += kColumnsAtOnce) {
    const Index width = std::min(kColumnsAtOnce, count - first);
    const RowMatrix some = extend(RowMatrix(values_.middleCols(first, width)));
    for (size_t r = 0; r < row_of_free_.size(); ++r)
      result.row(row_of_free_[r]).segment(first, width) = some.row(Index(r));
    if (progress) progress(static_cast<double>(first + width) / static_cast<double>(count));
  }
  return result;
}

const RowMatrix& HandleExtension::functions(RowMatrix& space) const {
  if (!solve_) return functions_;
  space = extended([&](const RowMatrix& values) { return solve_->extend(values); }, {});
  return space;
}

void HandleExtension::displace(const RowMatrix& coefficients, const Rows& rest, Rows& out) const {
  const RowMatrix reduced = coordinates_.reduced(coefficients);
  if (solve_) {
    solve_->add_extended(reduced, rest, out);
    return;
  }
  pool_->parallel_for(functions_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    kernels().blend(static_cast<int>(end - begin), static_cast<int>(functions_.cols()),
                    functions_.row(begin).data(), reduced.data(), rest.row(begin).data(),
                    out.row(begin).data());
  });
}

double HandleExtension::bytes() const {
  return static_cast<double>(functions_.size()) * sizeof(double) +
         static_cast<double>(values_.nonZeros()) * (sizeof(double) + sizeof(int)) +
         static_cast<double>(row_of_free_.size() * sizeof(int)) + (solve_ ? solve_->bytes() : 0);
}

}  // namespace dd
