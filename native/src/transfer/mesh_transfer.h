// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "mesh/correspondence.h"
#include "methods/method.h"
#include "support/similarity.h"
#include "surface/gradients.h"
#include "surface/tets.h"

namespace dd {

/// What decides where a transferred pose is: gradients leave the place of each loose part open.
enum class Anchor {
  source = 0,    ///< every part moves along with its source
  centroid = 1,  ///< the centre of the surface stays
  vertices = 2,  ///< the mean of the given vertices stays, or goes to the mean of given places
  pinned = 3     ///< each of the given vertices stays, or goes to its given place
};

struct TransferOptions {
  Formulation formulation = Formulation::surface;
  Anchor anchor = Anchor::source;
  std::vector<int> anchors;  ///< target vertices, for Anchor::vertices and pinned
  /// How the source lies to the target; null: as the correspondences say. See fitted_placement().
  const Similarity* placement = nullptr;
  Precision precision = Precision::full;
  int threads = 0;  ///< 0: as many as the machine has, at most 8
};

/// The similarity that takes the centres of source triangles next to those of the target triangles
/// they correspond to, weighted by the target's areas: see fitted_stance().
Similarity fitted_placement(const Mesh& source, const Mesh& target,
                            const Correspondence& correspondence);

/// Surface deformation transfer (§5) from a source pair S → S' to another mesh T: for each triangle
/// of T the mean S_j of the deformation gradients (15) of its sources, turned as the meshes lie to
/// each other, and L p' = div(S_jᵀ) (14) on T. Factored once; a pose is a pass over the triangles
/// and one back-substitution. Target triangles without a source go with the nearest that has one
/// across shared edges, or else vertices.
///
/// Each part of T that nothing pins is put where its source went: with A the placement, b_j the
/// centre of the sources of triangle j, c_j its own,
///
///   Σ_j w_j c'_j = Σ_j w_j (A(b'_j) + S_j (c_j − A(b_j))),   w_j = area_j / (ε² + ‖S_j − I‖²):
///
/// what doesn't deform decides, so that the shoulders rest while the jaw opens.
class MeshTransfer {
 public:
  /// Both meshes as for validate(); correspondence in their triangles. Throws Error; progress from
  /// 0 to 1.
  MeshTransfer(Mesh source, Mesh target, const Correspondence& correspondence,
               const TransferOptions& options, const Progress& progress = {});
  ~MeshTransfer();

  /// pose: S', in the source's units. places: of the anchors, or null for their places at rest.
  /// rotation_only: S_j reduced to its rotation. Returns T', valid until the next call.
  const Positions& apply(const Positions& pose, bool rotation_only,
                         const Positions* places = nullptr);

  const Mesh& source() const { return source_; }
  const Mesh& target() const { return target_; }
  int anchor_count() const { return static_cast<int>(anchors_.size()); }
  const Similarity& placement() const { return placement_; }
  /// Whether the target corresponds to a mirror image, of which the nearest rotation is taken.
  bool mirrored() const { return placement_.mirrored; }

  /// Target triangles without a source of their own, and one of them; -1: none.
  int unmatched_count = 0, unmatched_example = -1;
  /// Loose parts of the target none of whose triangles has a source, and a vertex of one.
  int unmatched_part_count = 0, unmatched_part_example = -1;
  /// Target vertices without a triangle, which stay at rest.
  int loose_count() const { return region_.loose_count; }
  const std::vector<int>& degenerate_triangles() const { return degenerate_; }
  /// Unknowns, and non-zeros of the system: of the surface's (14) or of the fourth points' (10).
  int unknowns() const { return unknowns_; }
  double nonzeros() const { return nonzeros_; }

 private:
  struct Part {
    std::vector<int> vertices;
    std::vector<int> triangles;  // those with a source
    bool pinned = false;
  };
  void match(const Correspondence& correspondence);
  void prepare_source();
  void factor(const TransferOptions& options, const Progress& progress);
  void find_parts();
  void find_source_gradients(const Positions& pose, bool rotation_only);
  /// Rotations of used triangles that a pose leaves without area, which has none: their
  /// neighbours'.
  void replace_collapsed(const Positions& pose);
  Eigen::Matrix3d gradient(int triangle, bool rotation_only) const;
  void solve_on_surface();
  void solve_with_fourth_points();
  /// Moves the floating parts of result_ to their sources, then all as the anchor says.
  void place(const Positions& pose, const Positions& anchor_places);

  Workers workers_;
  Mesh source_, target_;
  Anchor anchor_;
  std::vector<int> anchors_;
  Similarity placement_;

  // Of each target triangle where its sources are in source_; as of Correspondence, none empty but
  // where a whole part has none.
  std::vector<int> begin_, end_, sources_;
  std::vector<char> matched_;  // has sources of its own

  // The triangles of the source that are asked for, numbered anew.
  std::vector<int> source_stand_in_;  // of every triangle of the source
  std::vector<int> used_, stand_in_;  // triangle, and the one whose motion it takes; -1: none
  std::vector<Eigen::Matrix3d> rest_inverse_;  // [e1 e2 n]⁻¹ (15) of stand_in_
  std::vector<RotationBlock<double>> rotation_blocks_;
  std::vector<Eigen::Matrix3d> source_gradients_;
  Rows source_rows_, quaternions_;
  std::vector<Eigen::Matrix3d> gradients_;  // S_j of each target triangle

  double scale_ = 1;  // of the target; all below is solved in a box of diagonal 1
  Region region_;
  std::vector<int> degenerate_;
  std::unique_ptr<PoissonSystem> poisson_;
  Positions flux_;  // of the corners, three rows a triangle
  TetMesh tets_;
  std::unique_ptr<TetPoisson> volumetric_;
  int unknowns_ = 0;
  double nonzeros_ = 0;
  std::vector<Part> parts_;
  Eigen::VectorXd areas_;

  Positions displacement_, result_;
};

}  // namespace dd
