// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/split_motion.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "support/rotations.h"

namespace dd {

ScrewMotion::ScrewMotion(const Affine& motion, const Eigen::Vector3d& about,
                         const Eigen::Vector3d& turn, int handle)
    : motion_(motion), about_(about) {
  const Eigen::Matrix3d A = motion.leftCols<3>();
  // Safety: with a smaller ratio of volumes the rotation of A is rounding.
  if (!(A.determinant() > 1e-12 * std::pow(A.norm(), 3)))
    throw Error(Status::argument, {Subject::handle, handle},
                "flattens or mirrors, which can't be split into steps: use one step", Remedy::call);
  const Eigen::Matrix3d R = polar_rotation(A);
  stretch_ = R.transpose() * A - Eigen::Matrix3d::Identity();
  turn_ = rotation_vector_near(Eigen::AngleAxisd(R), turn);
  shift_ = A * about + motion.col(3) - about;
}

ScrewMotion::Affine ScrewMotion::at(double s) const {
  if (s == 1) return motion_;
  // The centre's path: with angle θ about the unit axis a, its displacement d is a slide along a
  // and a turn about the point at (d⊥ + cot(θ/2) a × d⊥) / 2 from it.
  const double angle = turn_.norm();
  Eigen::Vector3d moved = s * shift_;
  // Safety: the axis of a smaller angle is rounding, and so is the difference of the paths.
  if (angle > 1e-9) {
    const Eigen::Vector3d axis = turn_ / angle, slide = axis * axis.dot(shift_);
    const Eigen::Vector3d across = shift_ - slide;
    const double half = std::sin(angle / 2);
    // Whole turns with a displacement across the axis are no screw motion: then the centre moves
    // along a straight line. Safety: below 1e-6 the pivot is a million displacements away.
    if (std::abs(half) > 1e-6) {
      const Eigen::Vector3d pivot =
          0.5 * (across + std::cos(angle / 2) / half * axis.cross(across));
      moved = s * slide + pivot - rotation_by(s * turn_) * pivot;
    }
  }
  Affine result;
  result.leftCols<3>() = rotation_by(s * turn_) * (Eigen::Matrix3d::Identity() + s * stretch_);
  result.col(3) = about_ + moved - result.leftCols<3>() * about_;
  return result;
}

namespace {

std::vector<ScrewMotion> screw_motions(const Deformer& bound, const std::vector<double>& matrices,
                                       const std::vector<double>& turns) {
  const Positions centres = handle_centres(bound.region(), bound.mesh().positions);
  std::vector<ScrewMotion> screws;
  for (int h = 0; h < bound.region().handle_count; ++h) {
    const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(
        matrices.data() + 12 * static_cast<size_t>(h));
    Eigen::Vector3d turn = Eigen::Vector3d::Zero();
    if (!turns.empty())
      turn = Eigen::Map<const Eigen::Vector3d>(turns.data() + 3 * static_cast<size_t>(h));
    if (!matrix.allFinite() || !turn.allFinite())
      throw Error(Status::argument, {Subject::handle, h}, "has a matrix that is not finite",
                  Remedy::call);
    screws.emplace_back(matrix, centres.row(h).transpose(), turn, h);
  }
  return screws;
}

/// The handles' motions from time before to time now.
std::vector<double> between(const std::vector<ScrewMotion>& screws, double before, double now) {
  std::vector<double> matrices;
  for (const ScrewMotion& screw : screws) {
    Eigen::Matrix4d from = Eigen::Matrix4d::Identity(), to = from;
    from.topRows<3>() = screw.at(before);
    to.topRows<3>() = screw.at(now);
    const Eigen::Matrix<double, 3, 4, Eigen::RowMajor> change = (to * from.inverse()).topRows<3>();
    matrices.insert(matrices.end(), change.data(), change.data() + 12);
  }
  return matrices;
}

void require_splittable(const Deformer& bound, const SplitMotion& motion, MethodKind method) {
  if (bound.outside_base() && motion.steps != 1)
    throw Error(Status::argument, "A base from outside has no motion that could be split",
                Remedy::call);
  if (!facts(method).in_steps && motion.steps != 1)
    throw Error(Status::argument,
                "Posing by example goes to any pose in one step: steps would forget the rest",
                Remedy::call);
}

/// screws: of the whole motion; empty for one step.
UpdateOptions options_of_step(const UpdateOptions& update, const std::vector<ScrewMotion>& screws,
                              int step, int steps) {
  UpdateOptions options = update;
  if (step < steps) options.output = Output::result;
  if (steps == 1) return options;
  // A sheet that an earlier step has rolled up encloses something, and would become a limb.
  options.of_method.refined.solidity = 0;
  options.turns.clear();
  for (const ScrewMotion& screw : screws) {
    const Eigen::Vector3d turn = screw.turn() / steps;
    options.turns.insert(options.turns.end(), turn.data(), turn.data() + 3);
  }
  options.free.clear();
  return options;
}

/// Updates a deformer by one step and adds its offsets to those of the steps before.
void advance(Deformer& deformer, const std::vector<double>& matrices, const UpdateOptions& options,
             const Positions* deformed_base, SplitResult& result) {
  // Offsets are summed, because differences of positions would lose digits.
  result.offsets += deformer.update(matrices.data(), options, deformed_base);
  if (options.output == Output::base) return;  // the method was not run
  const MethodFindings findings = deformer.findings(options.method);
  result.volume_error = findings.volume_error;
  result.volumes_converged = findings.converged;
}

Error in_step(const Error& error, int step, int steps) {
  return {error.status(), error.subject(),
          error.message() + ", in step " + std::to_string(step) + " of " + std::to_string(steps),
          error.remedy(), error.vertices()};
}

}  // namespace

SplitResult split_update(Deformer& bound, const SplitMotion& motion, const UpdateOptions& update,
                         const Progress& progress, const Positions* deformed_base,
                         const std::function<void()>& on_deformer_released) {
  require_splittable(bound, motion, update.method);
  std::vector<ScrewMotion> screws;  // not needed for one step, where they may not exist
  if (motion.steps > 1) {
    std::vector<double> turns;
    const std::vector<double> matrices =
        bound.completed_matrices(motion.matrices.data(), update, turns);
    screws = screw_motions(bound, matrices, turns);
  }

  SplitResult result;
  result.offsets = Positions::Zero(bound.mesh().vertex_count(), 3);
  for (int step = 1; step <= motion.steps; ++step) {
    const double before = double(step - 1) / motion.steps, now = double(step) / motion.steps;
    const auto tell = [&](double within_step, Stage stage) {
      return !progress || progress(before + within_step * (now - before), stage);
    };
    // Fraction of a step that binding takes, for the progress alone: little if the method is slow.
    const double bound_at = step == 1 ? 0 : facts(update.method).slow ? 0.2 : 0.95;
    UpdateOptions options = options_of_step(update, screws, step, motion.steps);
    options.of_method.progress = [&](double fraction, Stage stage) {
      return tell(bound_at + (1 - bound_at) * fraction, stage);
    };
    try {
      if (step == 1) report(tell, 0, Stage::deforming);
      const std::vector<double> matrices =
          motion.steps > 1 ? between(screws, before, now) : motion.matrices;
      if (step == 1) {
        advance(bound, matrices, options, deformed_base, result);
        if (on_deformer_released) on_deformer_released();
        continue;
      }
      Mesh surface = {bound.mesh().positions + result.offsets, bound.mesh().triangles};
      Deformer deformer(std::move(surface), bound.region().role, bound.region().handle_count,
                        bound.bind_options(), [&](double fraction, Stage stage) {
                          return tell(bound_at * std::min(fraction, 0.999), stage);
                        });
      advance(deformer, matrices, options, deformed_base, result);
    } catch (const Error& error) {
      if (error.status() == Status::cancelled || motion.steps == 1) throw;
      throw in_step(error, step, motion.steps);
    }
  }
  report(progress, 1.0, Stage::done);
  return result;
}

}  // namespace dd
