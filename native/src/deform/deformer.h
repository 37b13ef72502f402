// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "base/base_proxy.h"
#include "base/free_turns.h"
#include "base/motion_blend.h"
#include "deform/mesh_part.h"
#include "mesh/unit_box.h"
#include "methods/methods.h"

namespace dd {

class CarriedComponents;

/// Which surface an update returns.
enum class Output {
  result = 0,
  base = 1  ///< B' in place of S'
};

struct UpdateOptions {
  MethodKind method = MethodKind::detail;
  BaseDeformer base_deformer = BaseDeformer::automatic;
  /// For each handle a rotation vector, 3 numbers, near which the logarithm of its rotation is
  /// taken, so that it may be more than half a turn; empty: the shortest rotations. See MotionBlend
  /// and ScrewMotion.
  std::vector<double> turns = {};
  /// For each handle whether it is free: its matrix places the pivot only, and its rotation is
  /// computed (see FreeTurns). Empty: all turn by their matrices.
  std::vector<char> free = {};
  /// The pivot of each free handle: the point at rest that its matrix places, in the mesh's units,
  /// a row for every handle. Empty: the handles' centres.
  Positions pivots = {};
  MethodOptions of_method;
  Output output = Output::result;
};

/// The options of a bind without base and examples, which fit one surface only and are large.
BindOptions without_surfaces(const BindOptions& options);

/// A surface bound to its handles: its systems are factored once, at construction, and updates use
/// the factors.
class Deformer {
 public:
  /// mesh and roles as for validate() and make_region(). Throws Error.
  Deformer(Mesh mesh, const std::vector<int>& roles, int handle_count, const BindOptions& options,
           const Progress& progress = {});
  ~Deformer();
  Deformer(const Deformer&) = delete;
  Deformer& operator=(const Deformer&) = delete;

  /// deformed_base: B' in the mesh's units if the surface was bound to a base from outside, with
  /// base_vertex_count() rows; else null. matrices: handle_count row-major 3×4 affine matrices from
  /// rest to the current pose, in the mesh's units. Returns the displacement of every vertex, n×3,
  /// in the mesh's units; valid until the next call. The first update by a method also prepares it,
  /// which may take longer. Throws Error(argument) naming the handle when a matrix is not finite,
  /// Error(numeric) when the result isn't.
  const Positions& update(const double* matrices, const UpdateOptions& options,
                          const Positions* deformed_base = nullptr);

  /// The same as floats: displacements, or positions; three of each vertex, stride floats after
  /// those of the vertex before. Also throws Error(numeric) where the result exceeds the range of
  /// floats. If it throws, out is unchanged.
  void update_to(float* out, Index stride, bool positions, const double* matrices,
                 const UpdateOptions& options, const Positions* deformed_base = nullptr);

  /// The matrices of an update, 12 numbers a handle, with the rotations that are found for free
  /// handles. turns: receives those of the options, likewise completed; empty if they are.
  std::vector<double> completed_matrices(const double* matrices, const UpdateOptions& options,
                                         std::vector<double>& turns);

  const Mesh& mesh() const { return mesh_; }
  /// The options of the bind, without base and examples, which fit this surface only.
  const BindOptions& bind_options() const { return bind_options_; }
  /// Whether updates need B'.
  bool outside_base() const { return bound_->outside_base(); }
  /// Rows of that deformed base.
  int base_vertex_count() const { return proxy_ ? proxy_->vertex_count() : mesh_.vertex_count(); }
  /// The binding of S to a base of another topology; null without one.
  const BaseProxy* proxy() const { return proxy_.get(); }
  const Region& region() const { return region_; }
  /// Of those that were bound: near the region, where that is a small part of the mesh.
  const std::vector<int>& degenerate_triangles() const { return degenerate_; }
  /// The findings of a method; the defaults, and example weights of zero, before its first update.
  MethodFindings findings(MethodKind method) const;
  double bytes() const;

  /// B at rest and as of the last update, n×3, in the mesh's units.
  Positions base() const;
  Positions deformed_base() const;

 private:
  /// Binds the part of the mesh that is bound, or all of it.
  void bind(const BindOptions& in_unit, const Progress& progress);
  /// The vertex of the mesh at a row of BoundSurface::order().
  int vertex_of(Index row) const {
    const int v = bound_->order().vertex_of_row[size_t(row)];
    return part_ ? part_->vertices[size_t(v)] : v;
  }
  /// Runs work on what is bound; its errors name vertices and triangles of the mesh.
  template <class Work>
  auto of_bound(const Work& work);
  /// Sets base_ and moved_.
  void move(const double* matrices, const UpdateOptions& options, const Positions* deformed_base);
  void move_bound(const double* matrices, const UpdateOptions& options,
                  const Positions* deformed_base);
  void take_matrices(const double* matrices);
  /// Finds the rotations of free handles and sets their motions and turns.
  void rotate_free_handles(const UpdateOptions& options, std::vector<double>& turns);
  /// The same for motions in the unit box.
  void find_free_rotations(const UpdateOptions& options, const Positions& pivots,
                           std::vector<MotionBlend::Affine>& motions, std::vector<double>& turns);
  /// The motions of the handles' matrices, in the unit box.
  std::vector<MotionBlend::Affine> motions() const;
  void move_base(MotionBlend& motions, BaseDeformer deformer);
  /// Adds what shows solid limbs to moved_, the displacement of the base.
  void show_limbs(MotionBlend& motions, const UpdateOptions& options);
  /// Sets base_ from a base given from outside.
  void take_base(const Positions* deformed);
  /// Hands the handles' current motions to the blend and returns it; once per frame.
  MotionBlend& blend(BaseDeformer deformer, const std::vector<double>& turns);
  /// The method, made on first use.
  Method& method(MethodKind kind, const Progress& progress);
  /// Throws Error(numeric) where a displacement, or the position with it, exceeds the range of
  /// floats.
  void require_floats();
  /// Converts rows in BoundSurface::order(), in the unit box, to n×3 vectors or positions in the
  /// mesh's units. Vectors outside of the part that is bound aren't written.
  void scale_to_mesh(const Rows& rows, Positions& vectors) const;
  Positions positions_in_mesh(const Rows& rows) const;

  ThreadPool pool_;
  BindOptions bind_options_;
  Mesh mesh_;
  Region region_;
  std::unique_ptr<MeshPart> part_;  // what is bound; null: the whole mesh
  std::vector<int> degenerate_;
  UnitBox box_;
  std::unique_ptr<BaseProxy> proxy_;
  std::unique_ptr<BoundSurface> bound_;
  std::array<std::unique_ptr<Method>, kMethodCount> methods_;  // by MethodKind

  RowMatrix coefficients_;  // 4h×4, unit box
  std::vector<Eigen::Matrix3d> linear_;
  // Made on first use:
  std::unique_ptr<MotionBlend> motions_;
  std::unique_ptr<FreeTurns> free_turns_;
  bool free_turns_solid_ = false;  // whether they know of limbs
  Rows base_, moved_;              // B' and the displacement, in BoundSurface::order(), unit box
  std::unique_ptr<CarriedComponents> carried_;  // null: there are none
  Positions offsets_;                           // made by the first update()
};

}  // namespace dd
