// SPDX-License-Identifier: GPL-3.0-or-later
// A deformer's update in terms of the tests' own types.
#pragma once

#include <algorithm>
#include <functional>

#include "catch.h"
#include "deform/deformer.h"
#include "meshes.h"

namespace dd::test {

inline UpdateOptions by(MethodKind method, bool rotation_only = true, int refine = 0) {
  UpdateOptions options;
  options.method = method;
  options.of_method.rotation_only = rotation_only;
  options.of_method.refined.iterations = refine;
  return options;
}

/// The defaults of the public interface, except for the number of iterations.
inline UpdateOptions usual(int refine = 4) {
  UpdateOptions options = by(MethodKind::detail, true, refine);
  options.of_method.refined.rim_smoothing = 0.05;
  return options;
}

/// Of one handle. turn: the rotation vector by which it knows whole turns.
inline UpdateOptions solid(double solidity = 1,
                           const Eigen::Vector3d& turn = Eigen::Vector3d::Zero()) {
  UpdateOptions options = usual();
  options.of_method.refined.solidity = solidity;
  options.turns.assign(turn.data(), turn.data() + 3);
  return options;
}

inline UpdateOptions shown_base() {
  UpdateOptions options = usual();
  options.output = Output::base;
  return options;
}

/// The paper's operators: of the mesh's own triangles, however obtuse they are.
inline BindOptions as_given(BaseMetric metric = BaseMetric::surface) {
  BindOptions options;
  options.base_metric = metric;
  options.triangulation = Triangulation::given;
  return options;
}

/// The deformed positions.
inline Positions surface(Deformer& deformer, const std::vector<Affine>& handles,
                         const UpdateOptions& options) {
  std::vector<double> matrices;
  for (const Affine& matrix : handles)
    matrices.insert(matrices.end(), matrix.data(), matrix.data() + 12);
  return deformer.mesh().positions + deformer.update(matrices.data(), options);
}

/// By the paper's linear method.
inline Positions surface(Deformer& deformer, const std::vector<Affine>& handles,
                         bool rotation_only = true) {
  return surface(deformer, handles, by(MethodKind::detail, rotation_only));
}

/// The surface at the end of a drag of one handle, from motion(0) to motion(1). Checks that there
/// are no jumps: in each step the farthest vertex, one of the handle's, moves by nearly the same.
inline Positions dragged(Deformer& deformer, int moves, const std::function<Affine(double)>& motion,
                         const UpdateOptions& options) {
  Positions last = surface(deformer, {motion(0)}, options);
  double longest = 0, shortest = 1e9;
  for (int k = 1; k <= moves; ++k) {
    const Positions now = surface(deformer, {motion(double(k) / moves)}, options);
    const double step = (now - last).rowwise().norm().maxCoeff();
    longest = std::max(longest, step);
    shortest = std::min(shortest, step);
    last = now;
  }
  CHECK(longest < 2 * shortest);
  return last;
}

/// The message of the Error with which body is refused.
inline std::string refusal(const std::function<void()>& body, Status expected) {
  try {
    body();
  } catch (const Error& error) {
    CHECK(error.status() == expected);
    return error.what();
  }
  return "accepted";
}

/// One handle holds all constrained vertices.
inline std::vector<int> held_by_one(std::vector<int> roles) {
  for (int& role : roles) role = role == kFree ? kFree : 0;
  return roles;
}

}  // namespace dd::test
