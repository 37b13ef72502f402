// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <optional>
#include <vector>

#include "surface/bound_surface.h"

namespace dd {

/// How the surface follows its handles. The values are those of dd_method in the public header.
enum class MethodKind {
  transfer = 0,
  variational = 1,
  normal = 2,
  gradient = 3,
  volumes = 4,
  examples = 5
};

/// How transfer makes (14) or (10) of the deformation gradients.
enum class Formulation {
  surface = 0,                  ///< §5: n unknowns
  fourth_points = 1,            ///< §3, weighted by volumes: n + m unknowns
  fourth_points_unweighted = 2  ///< (10) as it stands
};

struct MethodOptions {
  bool rotation_only = true;  ///< S_j reduced to its rotation
  int refine = 0;  ///< of transfer: iterations after its linear result; with rotation_only
  int levels = 1;  ///< of normal displacements: surfaces that each is displaced from the next
  double volume_tolerance = 1e-2;  ///< of displacement volumes: step to stop at, in mean heights
  int volume_iterations = 50;      ///< of displacement volumes: steps after which to stop anyway
  Formulation formulation =
      Formulation::surface;  ///< of transfer; others than surface aren't refined
  Progress progress = {};    ///< told how far a slow method is
  /// Of examples: the pose with these weights, handles let go; else the weights that fit the
  /// handles.
  std::optional<std::vector<double>> example_weights = {};
  double example_stiffness = 1;  ///< of examples: factor on what keeps weights small
};

/// One update on its way through a method.
struct Frame {
  /// For each handle the 4×3 block of HandleBasis (last column 0), and its linear part A.
  const RowMatrix& coefficients;
  const std::vector<Eigen::Matrix3d>& linear;
  const Rows& base;  ///< B', all rows in BoundSurface::order()
  Rows& offsets;     ///< displacement of S: in those of the handles' vertices, out the free ones'
};

/// A method over the shared operators and factors; made when it is first asked for.
class Method {
 public:
  virtual ~Method() = default;
  /// Sets the free rows of frame.offsets; those of handles too where these are let go.
  virtual void update(const Frame& frame, const MethodOptions& options) = 0;
  virtual double bytes() const = 0;
};

}  // namespace dd
