// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "../basis.h"
#include "../gradients.h"
#include "../sparse_cholesky.h"

namespace dd {

/// The paper's method (§6, Fig. 2): the base moves by its basis functions, its deformation
/// gradients S_j (15) or their rotations are carried over to S by L p' = div(S_jᵀ) (14).
///
/// Solved for the displacement, L (p' − p) = div(G_j S_jᵀ) − L p, so that resting handles give
/// exactly nothing and the size of the mesh costs no digits. The free rows of everything here stand
/// in the order of the Poisson factor: a frame then permutes nothing.
class Transfer {
 public:
  struct Input {
    const Mesh& mesh;
    const Region& region;
    const SurfaceOperators& operators;  ///< of S
    const Positions& base;              ///< B at rest
    const HandleBasis& basis;
  };
  explicit Transfer(const Input& input);

  /// coefficients: for each handle 4 rows of 4 doubles, the block C of HandleBasis (last column 0).
  /// handle_offsets: for each of Region::handle_vertices a row of 4 doubles, its displacement.
  void update(const double* coefficients, const double* handle_offsets, bool rotation_only);

  /// The vertex of each free row, and its displacement as rows of 4 doubles after update().
  const std::vector<int>& vertex_of_row() const { return vertex_of_row_; }
  const double* offsets() const { return rows_.data(); }

  int borrowed_count() const { return borrowed_count_; }
  double bytes() const;

  /// B' of the last update at a free row.
  Eigen::RowVector3d deformed_base_row(int row) const { return base_.row(row).head<3>(); }

 private:
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 4, Eigen::RowMajor>;
  struct HandleRow {
    int base_row, handle_vertex;  // the latter an index into Region::handle_vertices
  };
  struct BoundaryEntry {
    int row, handle_vertex;
    double weight;
  };
  int free_count() const { return static_cast<int>(vertex_of_row_.size()); }

  SparseCholesky poisson_;
  std::vector<int> vertex_of_row_;
  std::vector<HandleRow> handle_rows_;   // constrained base rows that move
  std::vector<BoundaryEntry> boundary_;  // L between free and handle vertices
  RowMatrix weights_;
  Rows rest_base_, base_;  // the free rows, then those of other vertices that are read
  Rows rest_divergence_;   // L p, free rows
  Rows rows_;              // right-hand side, then solution; one spare row
  int borrowed_count_ = 0;
  GradientPass pass_;
};

}  // namespace dd
