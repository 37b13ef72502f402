// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "mesh/unit_box.h"
#include "reconstruction/components.h"
#include "solver/sparse_cholesky.h"
#include "systems/region.h"
#include "transfer/contacts.h"
#include "transfer/part_sums.h"
#include "transfer/place_correction.h"
#include "transfer/source_points.h"

namespace dd {

/// Beyond the paper: gradients say how a surface turns and stretches, and where it is only as far
/// as they add up, so that lids which close on the source stay ajar on a target of another shape.
/// Here the places of the source have a say too. With A the placement and b_i the point of the
/// source that vertex p_i of the target corresponds to, what is between the meshes,
///
///   p_i − A(b_i) = ō_i + d_i,
///
/// is parted in how their shapes differ, ō, smooth over the surface, and the detail d, which turns
/// with the surface. In a pose the vertex is to be at
///
///   g_i = A(b'_i) + S_i d_i + M ō_i,    t_i = 1 / (1 + (‖(S_i − M) ō_i‖ / τ)⁴)
///
/// where S_i is the mean gradient about it and M that of what doesn't deform: a difference of shape
/// is carried along. Where it is so large that it matters whether it turns, which nothing tells,
/// t_i is next to none. The transferred surface p' is moved by the smooth part of what is missing,
///
///   (ℓ² L + D) Δ = D t (g − p'),   D: masses,
///
/// which leaves details as the gradients make them; a loose part that doesn't deform, such as an
/// eye or a tooth, is moved as a whole. Then what closes on the source is closed: see Contacts. All
/// of it is continuous in the pose, and none where the source moves rigidly.
class FollowedPlaces : public PlaceCorrection {
 public:
  /// components: of the target; those with sources that nothing holds follow. All must outlive
  /// this. Progress of two factorizations.
  FollowedPlaces(const Mesh& source, const Mesh& target, const UnitBox& box,
                 const std::vector<Component>& components, const SourcePoints& points,
                 const Similarity& placement, const SourceGradients& gradients, Precision precision,
                 ThreadPool& pool, const Progress& progress = {});

  /// pose: S', whose gradients were taken. result: T' as they make it; moved.
  void correct(const Positions& pose, Positions& result) override;

 private:
  /// A loose part. Means are over its rows whose place on the source is known.
  struct Part {
    std::vector<int> triangles;  // indices into triangles_
    std::vector<int> rows;
    double area = 0, mass = 0;
    Eigen::Vector3d before = Eigen::Vector3d::Zero();   // of A(b)
    Eigen::Vector3d between = Eigen::Vector3d::Zero();  // of what is between the meshes
  };
  /// How one moves in a pose.
  struct PartMotion {
    Eigen::Matrix3d turn;  // mean of S
    double spread;         // of the gradients
  };
  struct Motion {
    Eigen::Matrix3d linear;
    Eigen::Vector3d shift;
  };
  /// A shift, and its share of what moves a part.
  struct Stiffness {
    Eigen::RowVector3d shift = Eigen::RowVector3d::Zero();
    double share = 0;
  };
  void add(const Component& component, const Region& region, const Triangles& corners);
  void find_means();
  /// M, and the shift of A(b) that goes with it. parts: gets how each moves.
  Motion still_motion(const Positions& places, std::vector<PartMotion>& parts) const;
  /// A(b') of each row, zero where that isn't known.
  Positions places_of_source(const Positions& pose) const;
  /// t (g − p') of a row.
  Eigen::RowVector3d missing(Index row, const Positions& places, const Eigen::Matrix3d& still,
                             const Positions& result) const;
  /// What makes the move of a part that hardly deforms a shift, by which its centre goes as its
  /// source's. One that turns in its place, as an eye does, turns about its own.
  std::vector<Stiffness> stiffened(const std::vector<PartMotion>& motions, const Positions& places,
                                   const Motion& still, const Positions& result) const;
  void close(const Positions& places, Positions& result);

  const Similarity& placement_;
  const SourceGradients& gradients_;
  ThreadPool& pool_;
  Fans fans_;  // of the target
  const SourcePoints& points_;
  double different_;  // τ

  std::vector<int> triangles_;        // those with a source
  std::vector<int> row_of_triangle_;  // of a corner of each of these
  Eigen::VectorXd areas_;             // of these
  std::vector<Part> parts_;
  PartSums over_triangles_, over_rows_;  // of the parts
  // Of each row of the system:
  std::vector<int> vertices_;
  std::vector<int> part_of_row_;
  Eigen::VectorXd masses_;
  Positions rest_places_;     // A(b)
  Positions shape_, detail_;  // ō_i and d_i, in the target's units
  std::unique_ptr<SparseCholesky> factor_;
  SparseCholesky::Space space_;
  std::unique_ptr<Contacts> contacts_;
};

}  // namespace dd
