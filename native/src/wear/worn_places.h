// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "mesh/unit_box.h"
#include "solver/sparse_cholesky.h"
#include "systems/region.h"
#include "transfer/place_correction.h"
#include "transfer/source_gradients.h"
#include "transfer/source_points.h"
#include "wear/layers.h"
#include "wear/nearest_points.h"
#include "wear/outside.h"
#include "wear/probes.h"

namespace dd {

/// Beyond the paper: a garment stays where it was on a body, and outside of it. With b_i the point
/// of the source that vertex p_i of the target lies over, A the placement, and S_i the mean
/// gradient about the vertex, it is to be at
///
///   g_i = A(b'_i) + S_i (p_i − A(b_i)).
///
/// The transferred surface p' is moved by the smooth part of what is missing,
///
///   (ℓ² L + W) Δ = W (g − p'),   W = D / (1 + |p − A(b)|² / δ²),   D: masses,
///
/// so that what lies close keeps its place and what hangs loosely goes as the gradients make it.
/// Then vertices that have come nearer to the source than a gap, and by a quarter nearer than they
/// were at rest, are moved out (Outside), and so is what the source's own vertices have come as
/// near to (Probes): smoothly first, then each by itself. What lies over another part of the
/// garment (Layers) is kept as far from that. All of it is continuous in the pose, and none where
/// the source moves rigidly. Where the source folds up and goes through itself, which has no
/// outside, it fades away (FarSides).
class WornPlaces : public PlaceCorrection {
 public:
  /// region: of the target, of which the free vertices move. gap: of the box; negative: it isn't
  /// kept outside. All must outlive this.
  WornPlaces(const Mesh& source, const Mesh& target, const UnitBox& box, const Region& region,
             const NearestPoints& points, const Similarity& placement,
             const SourceGradients& gradients, double gap, Precision precision, ThreadPool& pool,
             const Progress& progress = {});

  /// pose: S', whose gradients were taken. result: T' as they make it; moved.
  void correct(const Positions& pose, Positions& result) override;

  /// Vertices that are through the source at rest, where that is looked at.
  const std::vector<int>& through() const { return through_; }

 private:
  RowMatrix smooth(const RowMatrix& values) const;
  void prepare_outside(const NearestPoints& points, double gap);
  /// How far vertices, what is over probes, and then layers, is to be moved along which direction.
  struct Shifts {
    Rows rows;  // direction and length
    /// Where vertices were looked at, and how much higher they were than they must be; 0: not yet.
    Positions seen;
    std::vector<double> spare;
  };
  /// Vertices that have come near since they were seen are looked at again. Returns whether
  /// anything is to be moved.
  bool look(const Positions& result, const Positions& upwards, Shifts& shifts) const;
  /// Of each layer the direction from what lies below it in the pose.
  Positions directions_of_layers() const;
  /// Of the shifts of each free vertex, its own and those for probes and layers, the mean, in
  /// which the longest have most of a say; and the mean of their lengths.
  Rows gathered(const Shifts& shifts) const;
  void move_out(Positions& result) const;

  const Mesh &source_, &target_;
  const Region& region_;
  const Similarity& placement_;
  const SourceGradients& gradients_;
  ThreadPool& pool_;
  Fans fans_;
  SourcePoints points_;
  double unit_;           // the target's box
  Positions arms_;        // p_i − A(b_i), of each row
  Eigen::VectorXd held_;  // W
  std::unique_ptr<SparseCholesky> factor_;

  std::unique_ptr<PosedSurface> body_;  // null: it may go through
  std::unique_ptr<Outside> outside_;    // of the vertices
  std::unique_ptr<Probes> probes_;
  std::unique_ptr<Layers> layers_;
  double side_ = 1;            // on which most of it is: −1 inside
  std::vector<double> least_;  // height that each, then over each probe, it must have
  std::vector<int> through_;
};

}  // namespace dd
