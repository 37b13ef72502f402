// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <algorithm>
#include <vector>

#include "solver/right_hand_side_layout.h"
#include "solver/sparse_cholesky.h"
#include "systems/free_block.h"
#include "systems/operators.h"
#include "systems/region.h"

namespace dd {

/// The order of rows in all arrays of a frame: free vertices in the order of the Poisson factor, so
/// that a solve needs no permutation, then handle vertices, then fixed ones.
struct RowOrder {
  std::vector<int> vertex_of_row;
  std::vector<int> row_of_vertex;
  int free_count = 0;   ///< rows below are free; the handles' begin here
  int fixed_begin = 0;  ///< first row of a fixed vertex

  int count() const { return static_cast<int>(vertex_of_row.size()); }
};

/// order_of_free: indices into Region::free in the wanted order.
RowOrder row_order(const Region& region, const std::vector<int>& order_of_free);

/// Doubles the diagonal entry of each ground vertex, because a component without constrained
/// vertices leaves its translation open. A right-hand side that sums to zero over the component, as
/// every divergence does, keeps the ground vertex in place whatever is added.
void ground(SparseMatrix& block, const Region& region);

/// The triangles with a free corner, the only ones that enter (14), grouped by the sections of the
/// Poisson factor: those of domain d are at begin[d] to begin[d + 1], and those of the top come
/// last. Triangles of two domains share no free vertices but those of the top.
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
/// so that with resting handles the result is zero up to rounding, and small displacements of a
/// large mesh lose no digits.
class PoissonSystem {
  /// Callback for SparseCholesky::solve_in_order(): rows ← rows + relaxation (x − rows). Defined
  /// before its uses, because its return type is deduced.
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
  /// outlive the system. With Precision::single the factor is kept in single precision if the error
  /// of a solve is at most 3e-6 of the diagonal of the mesh's bounding box, or below 5e-7 of it
  /// with one step of iterative refinement. Throws UnsolvableSurface where L is singular.
  PoissonSystem(const Mesh& mesh, const Region& region, const SurfaceOperators& operators,
                SparseMatrix block, BlockOptions options);

  const RowOrder& order() const { return order_; }
  const ActiveTriangles& active() const { return active_; }

  /// Constrained vertices of active triangles, as ascending rows of order().
  const std::vector<int>& rims() const { return rims_; }
  /// Active vertices, those of active triangles, have indices: the free ones as in order(), then
  /// rims(). active_row() gives the row in order() of such an index, active_index() the index of
  /// such a row.
  int active_vertex_count() const { return order_.free_count + static_cast<int>(rims_.size()); }
  int active_row(int index) const {
    return index < order_.free_count ? index : rims_[index - order_.free_count];
  }
  int active_index(int row) const {
    return row < order_.free_count ? row : order_.free_count + rim_of(row);
  }
  int active_vertex(int index) const { return order_.vertex_of_row[active_row(index)]; }
  /// The index of a vertex; −1: it isn't active.
  int active_index_of_vertex(int vertex) const {
    const int row = order_.row_of_vertex[vertex];
    const bool active =
        row < order_.free_count || std::binary_search(rims_.begin(), rims_.end(), row);
    return active ? active_index(row) : -1;
  }

  /// The row of the right-hand side to which a section adds the contribution of its active
  /// triangles to a vertex. Only divergence() reads the rows of rims.
  int right_hand_side_row(int section, int vertex) const;
  /// A row of the right-hand side for what the section discards, as unused lanes of its blocks do;
  /// never read.
  int discard_row(int section) const { return rows_.discard_row(section); }
  int right_hand_side_rows() const { return static_cast<int>(right_.rows()); }

  /// L p, rows as in a right-hand side.
  const Rows& rest_divergence() const { return rest_divergence_; }

  /// Solves for the free rows of offsets, the displacements of all vertices; the handles' rows are
  /// given. add(section, rows) adds the divergences of the active triangles of a section to rows;
  /// it is called once for each section, from any thread. at_rest: what all these calls add in the
  /// rest pose. The ground vertex of a component stays at rest. relaxation: over-relaxation,
  /// x ← x₀ + relaxation (x* − x₀), with x₀ the given free rows and x* the solution.
  template <class Add>
  void solve(const Rows& at_rest, const Add& add, Rows& offsets, double relaxation = 1) {
    const bool corrected = correction_steps_ > 0 && relaxation != 1;
    if (corrected) before_ = offsets.topRows(order_.free_count);
    factor_->solve_in_order(
        right_.data(), scratch_, &pool_,
        [&](int section) {
          start(section, at_rest, offsets);
          add(section, right_.data());
        },
        towards(offsets, corrected ? 1 : relaxation));
    for (int step = 0; step < correction_steps_; ++step) correct_residual(offsets);
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
    rows_.gather_slots(right_);
    return gather_rims();
  }
  int rim_begin() const { return rows_.count(); }

  /// After a solve(): as divergence(), but of the rims alone.
  const Rows& rim_divergence() { return gather_rims(); }

  /// Harmonic extension, L x = 0: sets the free rows of three columns of values from the handles'
  /// rows, with zero on fixed vertices.
  void extend(Rows& values);

  /// Solves L x = b on the free vertices. rows: F×4 in order(); in: b, out: x. In the precision of
  /// the factor, without refinement.
  void solve_free(Rows& rows);

  /// Stored entries of the factor.
  int64_t entries() const { return factor_->entries(); }
  /// Symbolic factorization of L, valid for every matrix of its pattern.
  std::shared_ptr<const SymbolicCholesky> symbolic() const { return factor_->shared_symbolic(); }

  ThreadPool& pool() const { return pool_; }
  Precision precision() const { return factor_->precision(); }
  /// Steps of iterative refinement after each solve.
  int correction_steps() const { return correction_steps_; }
  double bytes() const;

 private:
  void find_active_triangles(const Triangles& triangles);
  void find_rims(const Triangles& triangles);
  int rim_of(int row) const {
    return static_cast<int>(std::lower_bound(rims_.begin(), rims_.end(), row) - rims_.begin());
  }
  void find_couplings(const Region& region, const SparseMatrix& laplacian);
  /// Keeps the single-precision factor, adds a correction step, or factors in double precision, by
  /// the errors of a test. options: those of the factor that exists.
  void choose_precision(const Mesh& mesh, const Region& region, const SparseMatrix& block,
                        BlockOptions options);
  void sum_rest_divergence(const Mesh& mesh, const SurfaceOperators& operators);
  /// Sets a section's rows and slots of the right-hand side to −at_rest.
  void clear(int section, const Rows& at_rest);
  /// Sums what sections have added to the slots of rims, in rows of right_, which is returned.
  const Rows& gather_rims();
  /// Sets a section's rows and slots to −at_rest and moves the known displacements of the handles
  /// to the right-hand side, by the entries of L that couple them to free vertices.
  void start(int section, const Rows& at_rest, const Rows& offsets);
  /// A step of iterative refinement: solves for the residual of offsets and adds the result. After
  /// a solve, whose right-hand side it reads.
  void correct_residual(Rows& offsets);
  /// The largest absolute error of a solve. right: rows as in Region::free; solution: rows as in
  /// order().
  double solving_error(const Rows& right, const Rows& solution);

  struct Coupling {
    int free_row, handle_row;
    double weight;
  };

  ThreadPool& pool_;
  std::unique_ptr<SparseCholesky> factor_;
  RightHandSideLayout rows_;
  RowOrder order_;
  ActiveTriangles active_;
  std::vector<int> rims_;
  // Slots for what sections add to rims, stored after the rims' sums: the rim of each slot,
  // ascending within a section.
  std::vector<int> rim_of_slot_, rim_slot_begin_;
  std::vector<Coupling> couplings_;  // entries of L between free and handle vertices
  std::vector<int> coupling_begin_;  // by section
  Rows rest_divergence_;             // L p
  Rows right_;                       // rows_, then rims, then their slots
  SparseCholesky::SolveScratch scratch_;
  int correction_steps_ = 0;
  Eigen::SparseMatrix<double, Eigen::RowMajor> laplacian_;  // in the factor's order, for refinement
  Rows residual_, before_;
};

}  // namespace dd
