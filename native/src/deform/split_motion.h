// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <functional>
#include <vector>

#include "deform/deformer.h"

namespace dd {

/// A handle's motion M = (A, t), A = R U, as a path along its screw motion: M(s) turns by s times
/// the angle about the screw's axis and slides s times along it, after the stretch I + s (U − I)
/// about the handle's centre.
class ScrewMotion {
 public:
  using Affine = Eigen::Matrix<double, 3, 4>;
  /// about: the centre of the stretch. turn: rotation vector (axis times radians) near which the
  /// logarithm of R is taken, so that more than half a turn can be asked for; zero: the shortest.
  /// Throws Error(argument) about that handle when A has no inverse or mirrors.
  ScrewMotion(const Affine& motion, const Eigen::Vector3d& about, const Eigen::Vector3d& turn,
              int handle = 0);

  /// M(s): the identity at 0, M at 1.
  Affine at(double s) const;

  /// The rotation of the whole motion, a rotation vector with its whole turns.
  const Eigen::Vector3d& turn() const { return turn_; }

 private:
  Affine motion_;
  Eigen::Vector3d about_, turn_, shift_;  // rotation vector; displacement of the centre
  Eigen::Matrix3d stretch_;               // U − I
};

/// T-split (§6): the motions of all handles are divided into the same number of steps. After each
/// step the surface is bound anew to its result. One step is Deformer::update().
struct SplitMotion {
  std::vector<double> matrices;  ///< as for Deformer::update()
  int steps = 1;
};

/// The displacement of every vertex, n×3, and, with displacement volumes, how well the last step
/// preserved the volumes.
struct SplitResult {
  Positions offsets;
  double volume_error = 0;
  bool volumes_converged = true;
};

/// Arguments as for Deformer::update(), with the turns of the whole motion. One step only where the
/// motion can't be split: with a base from outside, and by examples. The first step updates the
/// bound deformer; later ones bind new surfaces and only read its constant parts.
/// on_deformer_released: called after the first step, from when on other threads may update the
/// deformer. Throws Error, naming the step.
SplitResult split_update(Deformer& bound, const SplitMotion& motion, const UpdateOptions& update,
                         const Progress& progress = {}, const Positions* deformed_base = nullptr,
                         const std::function<void()>& on_deformer_released = {});

}  // namespace dd
