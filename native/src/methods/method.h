// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "base/bound_surface.h"
#include "reconstruction/reconstruction.h"

namespace dd {

/// How the surface follows its handles. The values are those of dd_method in the public header.
enum class MethodKind {
  detail = 0,  ///< the paper's method
  variational = 1,
  normal = 2,
  gradient = 3,
  volumes = 4,
  examples = 5
};

struct MethodOptions {
  bool rotation_only = true;  ///< S_j reduced to its rotation
  /// Of detail with rotation_only, and of examples: refinement of the linear result.
  Refined refined = {};
  int levels = 1;  ///< of normal displacements: number of surfaces displaced from a smoother one
  /// Of displacement volumes: step length at which it has converged, in mean heights of the prisms.
  double volume_tolerance = 1e-2;
  int volume_iterations = 50;                      ///< of displacement volumes: limit on steps
  Formulation formulation = Formulation::surface;  ///< of detail; only surface is refined
  Progress progress = {};                          ///< called by slow methods
  /// Of examples: shows the pose of these weights, one for each example, ignoring the handles.
  /// Without, the weights are fitted to the handles.
  std::optional<std::vector<double>> example_weights = {};
  double example_stiffness = 1;  ///< of examples: s of the energy, see Examples
  /// Of examples: lower and upper limit of each example's weight, which contain 0; empty: none.
  std::vector<double> example_limits = {};
};

/// The input of one update of a method, and its output.
struct Frame {
  /// For each handle the block C of HandleCoordinates, 4×4 with last column 0, and its linear part.
  const RowMatrix& coefficients;
  const std::vector<Eigen::Matrix3d>& linear;
  const Rows& base;  ///< B', all rows in BoundSurface::order()
  const Turning& turning;
  const std::vector<char>& free;  ///< for each handle, whether only its pivot is placed; or empty
  Rows& offsets;  ///< displacement of S; in: rows of handles and fixed vertices, out: free rows
};

/// Diagnostics of a method about the surface and its last update.
struct MethodFindings {
  int stand_in_count = 0;       ///< triangles without area on B, which need a stand-in
  int coarse_vertex_count = 0;  ///< of the coarse surface of the refinement; 0: S itself is used
  /// Of normal displacements, for one level after the other: vertices at which a surface is not a
  /// height field over the next smoother one.
  std::vector<int> unrepresented = {};
  double volume_error = 0;                   ///< of displacement volumes: Σ |W_i' − W_i| / Σ |W_i|
  bool converged = true;                     ///< of displacement volumes
  std::vector<double> example_weights = {};  ///< of examples: found or given
};

/// A method on a BoundSurface, constructed on its first use.
class Method {
 public:
  virtual ~Method() = default;
  /// Sets the free rows of frame.offsets; also those of handles whose vertices it lets move freely.
  virtual void update(const Frame& frame, const MethodOptions& options) = 0;
  /// Whether limbs of the surface are solid with these options, and if so how far each vertex is
  /// part of one, 0 to 1; empty: none is.
  virtual bool is_solid(const MethodOptions&) const { return false; }
  virtual Eigen::VectorXd limbs(const MethodOptions&) { return {}; }
  /// Adds to B' what shows solid limbs, see LimbBase. base: rows in BoundSurface::order(),
  /// positions or displacements.
  virtual void show_limbs(const BasePose&, const Turning&, const MethodOptions&, Rows&) {}
  /// Throws Error(numeric) if the last update failed and left none.
  virtual MethodFindings findings() const { return {}; }
  virtual double bytes() const = 0;
};

}  // namespace dd
