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
#include "transfer/transfer_context.h"

namespace dd {

/// Beyond the paper: gradients determine how a surface turns and stretches, but its places only as
/// far as they are integrable. So lids that close on the source stay ajar on a target of another
/// shape. This correction uses the source's places, too. With A the placement and b_i the point of
/// the source that vertex p_i of the target corresponds to, the offset between the meshes,
///
///   p_i − A(b_i) = ō_i + d_i,
///
/// is split into a difference of shape ō, smooth over the surface, and the detail d, which turns
/// with the surface. In a pose the vertex has the goal g_i, and its correction the weight t_i,
///
///   g_i = A(b'_i) + S_i d_i + M ō_i,    t_i = 1 / (1 + (‖(S_i − M) ō_i‖ / τ)⁴),
///
/// where S_i is the mean gradient around it and M that of the triangles that deform least: a
/// difference of shape moves along with M. It isn't known whether it should turn with S_i instead,
/// so t_i is small where that matters. The transferred surface p' is moved by the smooth part of
/// what is missing,
///
///   (ℓ² L + D) Δ = D t (g − p'),   D: masses,
///
/// with ℓ a hundredth (kSmoothingLength) and τ 3/1000 (kShapeTolerance) of the diagonal of the
/// target's box. Details stay as the gradients make them. A loose part that doesn't deform, such as
/// an eye or a tooth, is shifted as a whole. Then gaps that close on the source are closed
/// (Contacts). The correction is continuous in the pose, and zero where the source moves rigidly.
class FollowedPlaces : public PlaceCorrection {
 public:
  /// Of the components those that have sources and aren't held are corrected. progress: of two
  /// factorizations.
  explicit FollowedPlaces(const TransferContext& context, const Progress& progress = {});

  /// pose: S', which SourceGradients::set_pose() was called with. result: T' by these, in;
  /// corrected, out.
  void correct(const Positions& pose, Positions& result) override;

 private:
  /// A loose part. Means are over its rows with a known source point, weighted by mass.
  struct FollowedPart {
    std::vector<int> triangles;  // indices into triangles_
    std::vector<int> rows;
    double area = 0, mass = 0;
    Eigen::Vector3d mean_source_position = Eigen::Vector3d::Zero();  // of A(b)
    Eigen::Vector3d mean_offset = Eigen::Vector3d::Zero();           // of p − A(b)
  };
  /// The motion of a part in a pose.
  struct PartMotion {
    Eigen::Matrix3d mean_gradient;  // mean of S
    double deviation;               // Σ area ‖S − mean_gradient‖²
  };
  struct AffineMotion {
    Eigen::Matrix3d linear;
    Eigen::Vector3d shift;
  };
  /// The shift of a part as a whole, and the share in [0, 1] that it replaces of the smooth
  /// correction.
  struct PartShift {
    Eigen::RowVector3d shift = Eigen::RowVector3d::Zero();
    double rigid_fraction = 0;
  };
  /// Adds the components that follow. Returns a region in which their vertices are free.
  Region add_parts(const std::vector<Component>& components);
  void add_part(const Component& component, const Region& region);
  /// Computes areas_ and masses_. areas: of the target's triangles.
  void measure(const Eigen::VectorXd& areas, const Region& region);
  /// Sets detail_ to p − A(b), and makes contacts_.
  void find_offsets(double contact_reach);
  void compute_means();
  /// M, and the shift with which it takes A(b) to A(b') where S deforms least. parts: gets the
  /// motions.
  AffineMotion least_deforming_motion(const Positions& source_positions,
                                      std::vector<PartMotion>& parts) const;
  /// A(b') of each row, zero if b isn't known.
  Positions positions_of_source(const Positions& pose) const;
  /// t (g − p') of a row.
  Eigen::RowVector3d weighted_residual(Index row, const Positions& source_positions,
                                       const Eigen::Matrix3d& still_motion,
                                       const Positions& result) const;
  /// For each part, the shift that moves its centre as its source's, and a share that is near 1 if
  /// the part hardly deforms. A part that turns in its place, as an eye does, turns about its own
  /// centre.
  std::vector<PartShift> part_shifts(const std::vector<PartMotion>& motions,
                                     const Positions& source_positions,
                                     const AffineMotion& still_motion,
                                     const Positions& result) const;
  void close_contacts(const Positions& source_positions, Positions& result);

  const Mesh& target_;
  const Similarity& placement_;
  const SourceGradients& gradients_;
  ThreadPool& pool_;
  VertexTriangles fans_;  // of the target
  const SourcePoints& points_;
  double shape_tolerance_;  // τ

  std::vector<int> triangles_;        // those with a source
  std::vector<int> row_of_triangle_;  // row of each one's first corner
  Eigen::VectorXd areas_;             // of these triangles
  std::vector<FollowedPart> parts_;
  PartSums triangle_sums_, row_sums_;  // of each part
  // Of each row of the system:
  std::vector<int> vertices_;
  std::vector<int> part_of_row_;
  Eigen::VectorXd masses_;
  Positions rest_positions_;  // A(b)
  Positions shape_, detail_;  // ō_i and d_i, in the target's units
  std::unique_ptr<SparseCholesky> factor_;
  SparseCholesky::SolveScratch space_;
  std::unique_ptr<Contacts> contacts_;
};

}  // namespace dd
