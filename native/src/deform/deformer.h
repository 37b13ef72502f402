// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "base/base_proxy.h"
#include "base/free_turns.h"
#include "base/motion_blend.h"
#include "mesh/unit_box.h"
#include "methods/methods.h"

namespace dd {

class CarriedComponents;

/// What an update shows.
enum class Output {
  result = 0,
  base = 1  ///< B' in place of S'
};

struct UpdateOptions {
  MethodKind method = MethodKind::detail;
  BaseDeformer base_deformer = BaseDeformer::automatic;
  /// For each handle a rotation vector, how far it is said to have turned, 3 numbers; or none: the
  /// shortest way. See MotionBlend and ScrewMotion.
  std::vector<double> turns = {};
  /// For each handle whether it only places (see FreeTurns), or none: all turn as their matrices.
  std::vector<char> free = {};
  /// For each handle the point at rest, in the mesh's units, that its matrix places where it is
  /// free, n×3; or none: the handles' centres.
  Positions pivots = {};
  MethodOptions of_method;
  Output output = Output::result;
};

/// A surface with its region bound: all that is factored once, and the update that isn't.
class Deformer {
 public:
  /// mesh and roles as for validate() and split_region(). Throws Error.
  Deformer(Mesh mesh, const std::vector<int>& roles, int handle_count, const BindOptions& options,
           const Progress& progress = {});
  ~Deformer();
  Deformer(const Deformer&) = delete;
  Deformer& operator=(const Deformer&) = delete;

  /// deformed_base: B' in the mesh's units, for a base from outside, as many vertices as that has;
  /// else null.
  /// matrices: handle_count row-major 3×4 affine matrices, rest to present, in the mesh's units.
  /// Returns the displacement of every vertex, n×3, in the mesh's units; valid until the next call.
  /// The first update by a method prepares it, which may take longer.
  /// Throws Error(argument) naming the handle when a matrix is not finite, Error(numeric) when the
  /// result isn't.
  const Positions& update(const double* matrices, const UpdateOptions& options,
                          const Positions* deformed_base = nullptr);

  /// The same, straight to floats: the displacement, or the positions, of each vertex three, stride
  /// floats apart. Throws Error(numeric) too where the result leaves their range. Whatever is
  /// thrown, out stays as it was.
  void update_to(float* out, Index stride, bool positions, const double* matrices,
                 const UpdateOptions& options, const Positions* deformed_base = nullptr);

  /// The matrices of an update, 12 numbers a handle, with the rotations of those that only place
  /// put in; and the turns, where there are any.
  std::vector<double> turned(const double* matrices, const UpdateOptions& options,
                             std::vector<double>& turns);

  const Mesh& mesh() const { return mesh_; }
  /// As it was bound, but for base and examples, which only this surface fits.
  const BindOptions& bind_options() const { return bind_options_; }
  /// Whether updates need B'.
  bool outside_base() const { return bound_->outside_base(); }
  /// Vertices of such a base.
  int base_vertex_count() const { return proxy_ ? proxy_->vertex_count() : mesh_.vertex_count(); }
  /// What binds S to a base of another topology; null where it is of its own.
  const BaseProxy* proxy() const { return proxy_.get(); }
  const Region& region() const { return region_; }
  const std::vector<int>& degenerate_triangles() const {
    return bound_->operators.metric.degenerate;
  }
  /// What a method found; before its first update nothing, and example weights of zero.
  MethodFindings findings(MethodKind method) const;
  double bytes() const;

  /// B at rest and as of the last update, n×3, in the mesh's units.
  Positions base() const;
  Positions deformed_base() const;

 private:
  void move(const double* matrices, const UpdateOptions& options, const Positions* deformed_base);
  void take_matrices(const double* matrices);
  /// Gives handles that only place their rotations; turns: with theirs put in.
  void turn_free(const UpdateOptions& options, std::vector<double>& turns);
  /// The same of motions in the unit box.
  void find_turns(const std::vector<char>& free, const Positions& pivots,
                  std::vector<MotionBlend::Affine>& motions, std::vector<double>& turns);
  /// Of the handles' matrices, in the unit box.
  std::vector<MotionBlend::Affine> motions() const;
  void move_base(MotionBlend& motions, BaseDeformer deformer);
  /// The one from outside.
  void take_base(const Positions* deformed);
  /// Of the handles' present matrices; for a frame it is taken once.
  MotionBlend& blend(BaseDeformer deformer, const std::vector<double>& turns);
  /// The method, prepared when it isn't yet.
  Method& method(MethodKind kind, const Progress& progress);
  /// Throws Error(numeric) where the displacement, or a position with it, leaves the range of
  /// floats.
  void require_floats();
  /// Rows in the order of the Poisson system, in the unit box, as n×3 vectors or positions outside.
  void scale_to_mesh(const Rows& rows, Positions& vectors) const;
  Positions place_in_mesh(const Rows& rows) const;

  ThreadPool pool_;
  BindOptions bind_options_;
  Mesh mesh_;
  Region region_;
  UnitBox box_;
  std::unique_ptr<BaseProxy> proxy_;
  std::unique_ptr<BoundSurface> bound_;
  std::array<std::unique_ptr<Method>, kMethodCount> methods_;  // by MethodKind

  RowMatrix coefficients_;  // 4h×4, unit box
  std::vector<Eigen::Matrix3d> linear_;
  // Made when they are first asked for.
  std::unique_ptr<MotionBlend> motions_;
  std::unique_ptr<FreeTurns> free_turns_;
  Rows base_, moved_;  // B' and the displacement, in BoundSurface::order(), unit box
  std::unique_ptr<CarriedComponents> carried_;  // where there are any
  Positions offsets_;
};

}  // namespace dd
