// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "mesh/unit_box.h"
#include "solver/sparse_cholesky.h"
#include "systems/region.h"
#include "transfer/place_correction.h"
#include "transfer/source_gradients.h"
#include "transfer/source_points.h"
#include "transfer/transfer_context.h"
#include "wear/layers.h"
#include "wear/nearest_points.h"
#include "wear/outside.h"
#include "wear/probes.h"

namespace dd {

/// Beyond the paper: keeps a garment in its place on a body, and outside of it. With b_i the point
/// of the source that vertex p_i of the target lies over, A the placement, and S_i the mean
/// gradient around the vertex, its goal is
///
///   g_i = A(b'_i) + S_i (p_i − A(b_i)).
///
/// The transferred surface p' is moved by the smooth part of what is missing,
///
///   (ℓ² L + W) Δ = W (g − p'),   W = D / (1 + |p − A(b)|² / δ²),   D: masses,
///
/// with the smoothing length ℓ and the distance δ one hundredth and one twentieth of the diagonal
/// of the target's box (kSmoothingLength, kLooseDistance), so that vertices close to the body keep
/// their places and loose ones follow the gradients. Then vertices are moved out (Outside) that
/// have come nearer to the source than a gap, and than three quarters of their distance at rest. So
/// are triangles to which the source's own vertices have come as near (Probes). These corrections
/// are smooth in the first rounds and by vertex in the last ones. Vertices over another layer of
/// the garment (Layers) keep three quarters of their distance from it. All corrections are
/// continuous in the pose, and zero where the source moves rigidly. Where the source folds through
/// itself, which leaves no outside, they fade out (FarSides).
class WornPlaces : public PlaceCorrection {
 public:
  /// region: of the target; its free vertices move. points: of the source, under the placement.
  /// gap: as a fraction of the diagonal of the target's box; negative: the garment isn't kept
  /// outside. All must outlive this.
  WornPlaces(const TransferContext& context, const Region& region, const NearestPoints& points,
             double gap, const Progress& progress = {});

  /// pose: S', which SourceGradients::set_pose() was called with. result: T' by these, in;
  /// corrected, out.
  void correct(const Positions& pose, Positions& result) override;

  /// Vertices that are on the wrong side of the source at rest; none without a gap.
  const std::vector<int>& penetrating() const { return penetrating_; }

 private:
  RowMatrix smooth(const RowMatrix& values) const;
  void prepare_outside(const NearestPoints& points, double gap);
  /// The shifts that vertices, then probes and then layers need, a row for each.
  struct Shifts {
    Rows rows;  // unit direction, length
    /// For each vertex, its position when its height was last computed, and by how much that
    /// exceeded its least height then; 0: not computed yet.
    Positions last_positions;
    std::vector<double> margins;
  };
  /// Computes the shifts, of a vertex only if it has moved by half of its margin.
  /// Returns whether anything needs to be moved. layer_directions: directions_of_layers().
  bool compute_shifts(const Positions& result, const Positions& layer_directions,
                      Shifts& shifts) const;
  /// For each layer, the unit vector to its vertex from the point below, turned by the pose's
  /// gradients.
  Positions directions_of_layers() const;
  /// For each free vertex, the mean of its own shift and those for probes and layers, and of their
  /// lengths, both weighted by the squared length.
  Rows mean_shifts(const Shifts& shifts) const;
  void move_out(Positions& result) const;

  const Mesh &source_, &target_;
  const Region& region_;
  const Similarity& placement_;
  const SourceGradients& gradients_;
  ThreadPool& pool_;
  VertexTriangles fans_;
  SourcePoints body_points_;
  double box_diagonal_;      // diagonal of the target's box
  Positions body_offsets_;   // p_i − A(b_i), of each row
  Eigen::VectorXd weights_;  // W
  std::unique_ptr<SparseCholesky> factor_;

  std::unique_ptr<PosedSurface> body_;  // null: the garment isn't kept outside
  std::unique_ptr<Outside> outside_;    // of the vertices
  std::unique_ptr<Probes> probes_;
  std::unique_ptr<Layers> layers_;
  double body_side_ = 1;             // of the body on which most of the garment is; −1: inside
  std::vector<double> min_heights_;  // least side × height of each vertex, then of each probe
  std::vector<int> penetrating_;
};

}  // namespace dd
