// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "mesh/correspondence.h"
#include "mesh/unit_box.h"
#include "reconstruction/components.h"
#include "reconstruction/corner_flux.h"
#include "reconstruction/reconstruction.h"
#include "support/similarity.h"
#include "transfer/place_correction.h"
#include "transfer/source_gradients.h"
#include "transfer/source_points.h"
#include "wear/worn_places.h"

namespace dd {

/// What determines the position of a transferred pose, since gradients leave the translation of
/// each component open.
enum class Anchor {
  source = 0,    ///< each component moves along with its source
  centroid = 1,  ///< the centre of the surface stays in place
  vertices = 2,  ///< the mean of the given vertices stays, or goes to that of given positions
  pinned = 3     ///< each of the given vertices stays, or goes to its given position
};

/// What is moved to where the source goes. The values are those of dd_placing in the public header.
enum class Placing {
  vertices = 0,      ///< each component, then each vertex: see FollowedPlaces, WornPlaces
  components = 1,    ///< each component as a whole: see ComponentPlaces
  parts = 2,         ///< each component as a whole, which keeps its shape: see RigidParts
  displacements = 3  ///< each vertex by its source's displacement
};

struct TransferOptions {
  Formulation formulation = Formulation::surface;
  Anchor anchor = Anchor::source;
  Placing placing = Placing::components;  ///< of components without a pinned vertex
  std::vector<int> anchors;  ///< vertices of the target, for Anchor::vertices and Anchor::pinned
  /// The similarity that takes the source onto the target; null: fitted_placement(), or the
  /// identity with worn.
  const Similarity* placement = nullptr;
  /// If the target is a garment that the source wears: the points of the source that its vertices
  /// and triangles lie over, with the source placed by `placement`; else null.
  const NearestPoints* worn = nullptr;
  /// Least distance of a garment from the source, with Placing::vertices, as a fraction of the
  /// diagonal of the target's box; negative: it may come through. See WornPlaces.
  double gap = -1;
  /// The point of the source that each vertex of the target corresponds to, triangle -1 where it is
  /// unknown. Unknown ones, or all if this is empty, follow from the correspondences. See
  /// points_of_fit().
  std::vector<PointOnTriangle> points = {};
  Precision precision = Precision::full;
  int threads = 0;  ///< 0: all of the machine's, at most 8
};

/// The similarity that fits the centres and normals of source triangles to those of the target
/// triangles that they correspond to, weighted by the target's areas: see fitted_placement().
Similarity fitted_placement(const Mesh& source, const Mesh& target,
                            const Correspondence& correspondence);

/// Surface deformation transfer (§5) from a source pair S → S' to another mesh T: the gradients of
/// the source's triangles are carried to those of T (SourceGradients), and L p' = div(S_jᵀ) (14) is
/// solved on T. Factored once; a pose costs a pass over the triangles and one solve.
///
/// Positions that gradients leave open are set by corrections, in this order: ComponentPlaces
/// places each component, the correction that `placing` asks for follows if there is one,
/// KeptTogether moves components along with pinned ones (but no garment, which stays on its
/// source), and the anchors shift the whole target.
class MeshTransfer {
 public:
  /// Both meshes: as for validate(). correspondence: of their triangles. Throws Error; progress
  /// from 0 to 1.
  MeshTransfer(Mesh source, Mesh target, const Correspondence& correspondence,
               const TransferOptions& options, const Progress& progress = {});
  ~MeshTransfer();

  /// pose: S', in the source's units. given_positions: of the anchors, or null for those at rest.
  /// rotation_only: S_j reduced to its rotation; not with Placing::vertices and displacements.
  /// Returns T', valid until the next call. Throws Error.
  const Positions& apply(const Positions& pose, bool rotation_only,
                         const Positions* given_positions = nullptr);

  const Mesh& source() const { return source_; }
  const Mesh& target() const { return target_; }
  int anchor_count() const { return static_cast<int>(anchors_.size()); }
  const Similarity& placement() const { return placement_; }
  /// Whether the target corresponds to a mirror image of the source and is deformed accordingly.
  bool mirrored() const { return placement_.mirrored; }

  const SourceGradients& gradients() const { return *gradients_; }
  /// The number of the target's components without any triangle that has a source, and a vertex of
  /// the first of them; −1: none.
  int unmatched_component_count() const { return unmatched_component_count_; }
  int unmatched_component_example() const { return unmatched_component_example_; }
  /// Target vertices without a triangle, which stay at rest.
  int isolated_count() const { return static_cast<int>(region_.isolated.size()); }
  const std::vector<int>& degenerate_triangles() const { return degenerate_; }
  /// Vertices of a garment that penetrate the source at rest: their number, and one of them or -1.
  int through_count() const { return worn_ ? static_cast<int>(worn_->penetrating().size()) : 0; }
  int through_example() const { return through_count() > 0 ? worn_->penetrating().front() : -1; }
  /// The mean distance of a garment's vertices from the source.
  double worn_distance() const { return worn_distance_; }
  /// Unknowns and non-zeros of the system, (14) or (10).
  int unknowns() const { return unknowns_; }
  double nonzeros() const { return nonzeros_; }

 private:
  struct OnTarget;

  void factor(const TransferOptions& options, const Progress& progress);
  void find_components();
  void add_corrections(const TransferOptions& options, const Progress& progress);
  Positions checked_anchor_positions(const Positions* given_positions) const;
  void solve(const Positions& anchor_positions);
  void keep_anchors(const Positions& anchor_positions);
  Eigen::RowVector3d shift_to_anchor(const Positions& anchor_positions) const;

  ThreadPool pool_;
  Mesh source_, target_;
  Anchor anchor_;
  std::vector<int> anchors_;
  Similarity placement_;
  std::unique_ptr<SourceGradients> gradients_;
  std::unique_ptr<OnTarget> on_target_;

  UnitBox box_;  // of the target; everything below is solved in it
  Region region_;
  std::vector<int> degenerate_;
  Eigen::VectorXd areas_;
  std::unique_ptr<FactoredSurface> surface_;          // of (14)
  std::unique_ptr<FourthPointSystem> fourth_points_;  // of (10)
  RowOrder order_;
  int unknowns_ = 0;
  double nonzeros_ = 0;

  std::vector<Component> components_;                          // with triangles that have a source
  std::unique_ptr<SourcePoints> points_;                       // for the corrections that need them
  std::vector<std::unique_ptr<PlaceCorrection>> corrections_;  // in the order in which they run
  bool need_whole_gradients_ = false;                          // whether a correction needs them
  const WornPlaces* worn_ = nullptr;                           // one of the corrections, or null
  double worn_distance_ = 0;
  int unmatched_component_count_ = 0, unmatched_component_example_ = -1;
  Rows offsets_;  // in order_, unit box
  Positions result_;
};

}  // namespace dd
