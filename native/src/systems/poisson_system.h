// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "solver/section_rows.h"
#include "solver/sparse_cholesky.h"
#include "systems/free_block.h"
#include "systems/operators.h"
#include "systems/region.h"

namespace dd {

/// The order of the rows in all that a frame works on: the free vertices as they stand in the
/// Poisson factor, so that a solve permutes nothing, then the handles' vertices, then the fixed.
struct RowOrder {
  std::vector<int> vertex_of_row;
  std::vector<int> row_of_vertex;
  int free_count = 0;   ///< rows below are free, those from here on the handles'
  int fixed_begin = 0;  ///< first row of a fixed vertex

  int count() const { return static_cast<int>(vertex_of_row.size()); }
};

/// order_of_free: the rows of Region::free in the wanted order.
RowOrder row_order(const Region& region, const std::vector<int>& order_of_free);

/// A component that nothing holds leaves its translation open. A right-hand side that sums to zero
/// over it, as every divergence does, keeps the grounded vertex in place whatever its added weight.
void ground(SparseMatrix& block, const Region& region);

/// The triangles with a free corner, the only ones whose gradients matter, as they share out over
/// the domains of the Poisson factor: those of domain d at begin[d] to begin[d + 1], then those of
/// the top. No two domains have a free vertex in common but the top's.
struct ActiveTriangles {
  std::vector<int> triangles;
  std::vector<int> begin;

  int sections() const { return static_cast<int>(begin.size()) - 1; }
  int size() const { return static_cast<int>(triangles.size()); }
};

/// L p' = div(...) (4), (14) on the free vertices, factored once, solved for the displacement:
///
///   L (p' − p) = div(G_j S_jᵀ) − L p
///
/// so that resting handles give nothing but rounding and the mesh's size costs no digits.
class PoissonSystem {
  /// What SparseCholesky::solve_in_order() calls with its results, to move rows towards them by
  /// relaxation times the way. Its deduced type is known only below it.
  static auto towards(Rows& rows, double relaxation) {
    return [out = rows.data(), relaxation](int begin, int end, const auto* x) {
      double* row = out + 4 * Index(begin);
      if (relaxation == 1) {
        std::copy(x, x + 4 * Index(end - begin), row);
        return;
      }
      for (const double* last = out + 4 * Index(end); row != last; ++row, ++x)
        *row += relaxation * (static_cast<double>(*x) - *row);
    };
  }

 public:
  /// operators: of S. block: free_block() of their Laplacian. options: with a pool, which must
  /// outlive the system. With Precision::single the factor is kept in single precision where that
  /// solves to 3e-6 of the mesh's size, or to 5e-7 with a step of iterative refinement.
  /// Throws UnsolvableSurface where L is singular.
  PoissonSystem(const Mesh& mesh, const Region& region, const SurfaceOperators& operators,
                SparseMatrix block, BlockOptions options);

  const RowOrder& order() const { return order_; }
  const ActiveTriangles& active() const { return active_; }

  /// Constrained vertices of active triangles, by their rows in order(), ascending.
  const std::vector<int>& rims() const { return rims_; }
  /// The vertices of active triangles, numbered: free ones in order(), then rims. Their number, the
  /// row in order() of each number, and the number of such a row.
  int active_vertex_count() const { return order_.free_count + static_cast<int>(rims_.size()); }
  int active_row(int place) const {
    return place < order_.free_count ? place : rims_[place - order_.free_count];
  }
  int active_place(int row) const {
    return row < order_.free_count ? row : order_.free_count + rim_of(row);
  }
  int active_vertex(int place) const { return order_.vertex_of_row[active_row(place)]; }

  /// The row of the right-hand side to which a section adds the contribution of its active
  /// triangles to a vertex. Only divergence() reads the rows of rims.
  int target(int section, int vertex) const;
  /// The row of a section that nobody reads.
  int spare_target(int section) const { return rows_.spare(section); }
  int right_hand_side_rows() const { return static_cast<int>(right_.rows()); }

  /// L p, in the rows of a right-hand side.
  const Rows& rest_divergence() const { return rest_divergence_; }

  /// Solves for the free rows of offsets, the displacements of all vertices; the rows of handles
  /// are given. add(section, rows) adds the divergences of the active triangles of a section to
  /// rows; it is called from any thread, once for each section. at_rest: the sum of these at rest.
  /// In a component with a ground vertex that vertex stays at rest. relaxation: over-relaxation,
  /// x ← x₀ + relaxation (x* − x₀), with x₀ the given free rows and x* the solution.
  template <class Add>
  void solve(const Rows& at_rest, const Add& add, Rows& offsets, double relaxation = 1) {
    const bool corrected = correction_steps_ > 0 && relaxation != 1;
    if (corrected) before_ = offsets.topRows(order_.free_count);
    factor_->solve_in_order(
        right_.data(), space_, &pool_,
        [&](int section) {
          start(section, at_rest, offsets);
          add(section, right_.data());
        },
        towards(offsets, corrected ? 1 : relaxation));
    for (int step = 0; step < correction_steps_; ++step) refine(offsets);
    if (corrected) {
      auto now = offsets.topRows(order_.free_count);
      now = before_ + relaxation * (now - before_);
    }
  }

  /// The sum of the sections' contributions to each vertex minus at_rest. Rows: free vertices in
  /// order(), and from rim_begin() on rims(). Valid until the next call of any member.
  template <class Add>
  const Rows& divergence(const Rows& at_rest, const Add& add) {
    run_tasks(&pool_, active_.sections(), [&](int section) {
      clear(section, at_rest);
      add(section, right_.data());
    });
    fold();
    return right_;
  }
  int rim_begin() const { return rows_.count(); }

  /// Harmonic extension, L x = 0: the free rows of three columns of values from the handles' rows,
  /// with zero on the fixed ones.
  void extend(Rows& values);

  /// Entries of the factor.
  int64_t entries() const { return factor_->entries(); }
  /// Of L, and of every matrix of its pattern.
  std::shared_ptr<const SymbolicCholesky> symbolic() const { return factor_->shared_symbolic(); }

  ThreadPool& pool() const { return pool_; }
  Precision precision() const { return factor_->precision(); }
  /// Steps of iterative refinement that follow a solve.
  int correction_steps() const { return correction_steps_; }
  double bytes() const;

 private:
  void find_active_triangles(const Triangles& triangles);
  void find_rims(const Triangles& triangles);
  int rim_of(int row) const {
    return static_cast<int>(std::lower_bound(rims_.begin(), rims_.end(), row) - rims_.begin());
  }
  void clear(int section, const Rows& at_rest);
  void fold();
  void start(int section, const Rows& at_rest, const Rows& offsets);
  void refine(Rows& offsets);
  /// The largest error of the solution for a right-hand side in the order of the region.
  double solving_error(const Rows& right, const Rows& solution);

  struct Pull {
    int target_row, handle_row;
    double weight;
  };

  ThreadPool& pool_;
  std::unique_ptr<SparseCholesky> factor_;
  SectionRows rows_;
  RowOrder order_;
  ActiveTriangles active_;
  std::vector<int> rims_;
  // What a section gives to rims, behind their sums: the rim of each slot, ascending in a section.
  std::vector<int> rim_of_slot_, rim_slot_begin_;
  std::vector<Pull> pulls_;      // L between free vertices and those of handles
  std::vector<int> pull_begin_;  // by section
  Rows rest_divergence_;         // L p
  Rows right_;                   // as rows_ says, then rims and their slots
  SparseCholesky::Space space_;
  int correction_steps_ = 0;
  Eigen::SparseMatrix<double, Eigen::RowMajor> laplacian_;  // in the factor's order, to refine with
  Rows residual_, before_;
};

}  // namespace dd
