// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "base/bound_surface.h"
#include "reconstruction/reconstruction.h"

namespace dd {

/// How the surface follows its handles. The values are those of dd_method in the public header.
enum class MethodKind {
  detail = 0,  ///< the paper's
  variational = 1,
  normal = 2,
  gradient = 3,
  volumes = 4,
  examples = 5
};

struct MethodOptions {
  bool rotation_only = true;  ///< S_j reduced to its rotation
  /// Of detail with rotation_only: what goes beyond its linear result.
  Refined refined = {};
  int levels = 1;  ///< of normal displacements: surfaces that each is displaced from the next
  double volume_tolerance = 1e-2;  ///< of displacement volumes: step to stop at, in mean heights
  int volume_iterations = 50;      ///< of displacement volumes: steps after which to stop anyway
  Formulation formulation =
      Formulation::surface;  ///< of detail; others than surface aren't refined
  Progress progress = {};    ///< told how far a slow method is
  /// Of examples: the pose with these weights, handles let go; else the weights that fit the
  /// handles.
  std::optional<std::vector<double>> example_weights = {};
  double example_stiffness = 1;  ///< of examples: factor on what keeps weights small
  /// Of examples: the least and the largest weight of each, 0 among them; or none.
  std::vector<double> example_limits = {};
};

/// One update on its way through a method.
struct Frame {
  /// For each handle the 4×3 block C of HandleCoordinates (last column 0), and its linear part A.
  const RowMatrix& coefficients;
  const std::vector<Eigen::Matrix3d>& linear;
  const Rows& base;  ///< B', all rows in BoundSurface::order()
  const Turning& turning;
  const std::vector<char>& free;  ///< by handle, whether it only places; or none
  Rows& offsets;  ///< displacement of S: in those of the handles' vertices, out the free ones'
};

/// What a method found out about the surface or about its last update.
struct MethodFindings {
  int stand_in_count = 0;       ///< triangles whose base has no area: others stand in for them
  int coarse_vertex_count = 0;  ///< of the surface on which rotations are refined; 0: of S itself
  /// Vertices at which S is no height field over the next smoother surface, of one level of normal
  /// displacements after the other.
  std::vector<int> unrepresented = {};
  double volume_error = 0;                   ///< of displacement volumes: Σ |W_i' − W_i| / Σ |W_i|
  bool converged = true;                     ///< whether these converged within their iterations
  std::vector<double> example_weights = {};  ///< one for each example
};

/// A method over the shared operators and factors; made when it is first asked for.
class Method {
 public:
  virtual ~Method() = default;
  /// Sets the free rows of frame.offsets; those of handles too where these are let go.
  virtual void update(const Frame& frame, const MethodOptions& options) = 0;
  /// Throws Error(numeric) where the last update left none.
  virtual MethodFindings findings() const { return {}; }
  virtual double bytes() const = 0;
};

}  // namespace dd
