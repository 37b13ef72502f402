// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/free_turns.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

#include "reconstruction/whole_surface.h"
#include "support/rotations.h"

namespace dd {

namespace {

// Largest angle between other handles, 135°, up to which the rotation of least energy is the
// result, as up to there the linear base of MotionBlend is. From 180° on the harmonically
// interpolated rotation is the result; in between the two are mixed.
constexpr double kMinimizedUntil = 0.75 * kPi;

// Weight of the identity beside the covariance of two point sets, as a fraction of its norm: where
// collinear points leave a rotation open, it selects the smallest one.
constexpr double kSmallestRotationWeight = 1e-6;
// Shift of the diagonal of D_ff, relative to its largest entry, and that entry's least value: a
// handle that nothing connects to others has a zero row, and its weights become zero.
constexpr double kUnconnectedShift = 1e-12;
// Largest turn to begin with, 150°. Safety: from half a turn on an arc may lie on either side.
constexpr double kMaxArc = kPi * 5 / 6;

/// The rotation that best aligns two point sets about their means (least squares).
Eigen::Matrix3d rotation_between(const Positions& from, const Positions& to) {
  const Positions a = from.rowwise() - from.colwise().mean();
  const Positions b = to.rowwise() - to.colwise().mean();
  Eigen::Matrix3d covariance = b.transpose() * a;
  covariance.diagonal().array() += kSmallestRotationWeight * covariance.norm();
  return polar_rotation(covariance);
}

/// Replaces a handle's linear part by a rotation; its pivot goes to the same position as before.
void rotate_about_pivot(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& pivot,
                        MotionBlend::Affine& motion) {
  const Eigen::Vector3d deformed_pivot = motion.leftCols<3>() * pivot + motion.col(3);
  motion.leftCols<3>() = rotation;
  motion.col(3) = deformed_pivot - rotation * pivot;
}

}  // namespace

/// What is interpolated harmonically from the other handles, for each free handle: its rotation,
/// the same as a rotation vector with whole turns, and the fraction in [0, 1] by which it replaces
/// the rotation of least energy in the result.
struct FreeTurns::Interpolated {
  std::vector<Eigen::Matrix3d> rotations;
  std::vector<Eigen::Vector3d> turns;
  std::vector<double> interpolated_fractions;
};

FreeTurns::FreeTurns(const BoundSurface& bound, std::vector<char> free,
                     const Eigen::VectorXd& limbs)
    : bound_(bound), free_(std::move(free)), energy_(bound, free_, limbs) {
  find_groups();
  if (!bound.outside_base()) find_harmonic_weights();
}

void FreeTurns::find_harmonic_weights() {
  // forces = D, the Dirichlet energy of the harmonic weights, h×h (the Schur complement of L). The
  // values of free handles with the least energy, given those of the others, have zero force: D_ff
  // x_f = −D_fo x_o.
  const RowOrder& order = bound_.order();
  const std::vector<int>& free_handles = energy_.free_handles();
  const int all = bound_.region.handle_count, own = static_cast<int>(free_handles.size());
  holds_.assign(size_t(own), {});
  RowMatrix forces = RowMatrix::Zero(all, all);
  const auto each_neighbour = [&](const auto& use) {
    for (int v : bound_.region.handle_vertices)
      for (SparseMatrix::InnerIterator it(bound_.operators.laplacian, v); it; ++it)
        use(bound_.region.role[v], static_cast<int>(it.row()), it.value());
  };
  each_neighbour([&](int handle, int neighbour, double value) {
    const int role = bound_.region.role[neighbour];
    if (role >= 0) forces(handle, role) += value;
  });
  for_each_harmonic_weights(
      bound_, extension_over(bound_), [&](int first, int some, const Rows& values) {
        for (int column = 0; column < some; ++column)
          if (free_[size_t(first + column)]) add_to_hold(first + column, column, values);
        each_neighbour([&](int handle, int neighbour, double value) {
          const int row = order.row_of_vertex[neighbour];
          if (row < order.free_count)
            forces.row(handle).segment(first, some) += value * values.row(row).head(some);
        });
      });
  RowMatrix among(own, own), others(own, all);
  for (int i = 0; i < own; ++i) {
    others.row(i) = forces.row(free_handles[i]);
    for (int k = 0; k < own; ++k) {
      among(i, k) = forces(free_handles[i], free_handles[k]);
      others(i, free_handles[k]) = 0;
    }
  }
  among.diagonal().array() +=
      kUnconnectedShift * (kUnconnectedShift + among.diagonal().cwiseAbs().maxCoeff());
  harmonic_weights_ = -Eigen::LDLT<Eigen::MatrixXd>(among).solve(others);
}

/// Adds the rims that a free handle's harmonic weights, in a column of weights, flow to.
void FreeTurns::add_to_hold(int handle, int column, const Rows& weights) {
  const std::vector<int>& free_handles = energy_.free_handles();
  const auto own = std::lower_bound(free_handles.begin(), free_handles.end(), handle);
  std::vector<Hold>& holds = holds_[size_t(own - free_handles.begin())];
  holds.resize(free_.size() + 1);
  const RowOrder& order = bound_.order();
  for (const int rim : bound_.poisson->rims()) {
    const int v = order.vertex_of_row[size_t(rim)], role = bound_.region.role[size_t(v)];
    if (role >= 0 && free_[size_t(role)]) continue;
    double flux = 0;
    for (SparseMatrix::InnerIterator it(bound_.operators.laplacian, v); it; ++it)
      if (const int row = order.row_of_vertex[size_t(it.row())]; row < order.free_count)
        flux -= it.value() * weights(row, column);
    Hold& hold = role >= 0 ? holds[size_t(role)] : holds.back();
    const Eigen::Vector3d p = bound_.mesh.positions.row(v);
    hold.weight += flux;
    hold.sum += flux * p;
    hold.squares += flux * p.squaredNorm();
  }
}

/// A handle at the tip of a limb, led aside, turns like the end of an arc: by twice the angle of
/// its chord. Without this start, the energy of a thin limb has a saddle near an S with an unturned
/// tip.
Eigen::Matrix3d FreeTurns::turned_like_an_arc(size_t free_index, const Eigen::Matrix3d& rotation,
                                              const std::vector<Affine>& motions,
                                              const Eigen::Vector3d& pivot) const {
  double weight = 0, squares = 0;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero(), moved = sum;
  for (size_t h = 0; h < holds_[free_index].size(); ++h) {
    const Hold& hold = holds_[free_index][h];
    weight += hold.weight;
    squares += hold.squares;
    sum += hold.sum;
    moved +=
        h < motions.size()
            ? Eigen::Vector3d(motions[h].leftCols<3>() * hold.sum + hold.weight * motions[h].col(3))
            : hold.sum;
  }
  if (!(weight > 0)) return rotation;
  const Eigen::Vector3d chord = pivot - sum / weight;
  const Affine& own = motions[size_t(energy_.free_handles()[free_index])];
  const Eigen::Vector3d to = own.leftCols<3>() * pivot + own.col(3) - moved / weight;
  if (!std::isfinite(to.squaredNorm())) return rotation;
  // A limb is longer than what holds it is wide, from once to twice as long.
  const double spread = std::sqrt(std::max(std::numeric_limits<double>::min(),
                                           squares / weight - (sum / weight).squaredNorm()));
  const double fraction = std::clamp(chord.norm() / spread - 1, 0.0, 1.0);
  const Eigen::AngleAxisd turn(Eigen::Quaterniond::FromTwoVectors(rotation * chord, to));
  return rotation_by(fraction * std::min(2 * turn.angle(), kMaxArc) * turn.axis()) * rotation;
}

void FreeTurns::find_groups() {
  const Region& region = bound_.region;
  const Components components = components_of(bound_);
  // A handle merges all components that contain vertices of it (union-find).
  std::vector<int> first(free_.size(), -1), joined(size_t(components.count));
  std::iota(joined.begin(), joined.end(), 0);
  const auto root = [&](int component) {
    while (joined[component] != component) component = joined[component];
    return component;
  };
  for (int v : region.handle_vertices) {
    int& component = first[region.role[v]];
    if (component < 0)
      component = components.of_vertex[v];
    else
      joined[root(components.of_vertex[v])] = root(component);
  }
  std::map<int, HandleGroup> groups;
  for (size_t h = 0, own = 0; h < free_.size(); ++h) {
    HandleGroup& group = groups[root(first[h])];
    if (free_[h])
      group.free.push_back(static_cast<int>(own++));
    else
      group.prescribed.push_back(static_cast<int>(h));
  }
  for (size_t v = 0; v < region.role.size(); ++v) {
    if (region.role[v] != kFixed) continue;
    const auto found = groups.find(root(components.of_vertex[v]));
    if (found != groups.end()) found->second.fixed = true;
  }
  for (auto& [number, group] : groups)
    if (!group.free.empty()) groups_.push_back(std::move(group));
}

FreeTurns::Interpolated FreeTurns::interpolate(const std::vector<Affine>& motions,
                                               const Positions& pivots,
                                               const std::vector<double>& turns) const {
  const size_t own = energy_.free_handles().size();
  Interpolated result{std::vector<Eigen::Matrix3d>(own, Eigen::Matrix3d::Identity()),
                      std::vector<Eigen::Vector3d>(own, Eigen::Vector3d::Zero()),
                      std::vector<double>(own, 0.0)};
  for (const HandleGroup& group : groups_) interpolate(group, motions, pivots, turns, result);
  return result;
}

void FreeTurns::interpolate(const HandleGroup& group, const std::vector<Affine>& motions,
                            const Positions& pivots, const std::vector<double>& turns,
                            Interpolated& result) const {
  if (group.prescribed.empty()) {
    if (group.fixed) return;
    Positions from(Index(group.free.size()), 3), to(from.rows(), 3);
    for (size_t i = 0; i < group.free.size(); ++i) {
      const int h = energy_.free_handles()[size_t(group.free[i])];
      const Eigen::Vector3d pivot = pivots.row(h);
      const Affine& motion = motions[size_t(h)];
      from.row(Index(i)) = pivot.transpose();
      to.row(Index(i)) = (motion.leftCols<3>() * pivot + motion.col(3)).transpose();
    }
    const Eigen::Matrix3d joint_rotation = rotation_between(from, to);
    for (int i : group.free) result.rotations[size_t(i)] = joint_rotation;
    return;
  }

  const auto given_turn = [&](int h) -> Eigen::Vector3d {
    if (turns.empty()) return Eigen::Vector3d::Zero();
    return Eigen::Map<const Eigen::Vector3d>(turns.data() + 3 * size_t(h));
  };
  // Rotations are relative to the fixed vertices, or without these to the first handle that isn't
  // free.
  const int reference = group.prescribed[0];
  const Eigen::Vector3d first_turn = group.fixed ? Eigen::Vector3d::Zero() : given_turn(reference);
  const Eigen::Matrix3d first =
      group.fixed ? Eigen::Matrix3d::Identity()
                  : rotation_or(motions[size_t(reference)].leftCols<3>(), first_turn);
  RowMatrix angles = RowMatrix::Zero(Index(free_.size()), 3);
  double largest_angle = 0;
  for (int h : group.prescribed) {
    const Eigen::Vector3d turn = first.transpose() * (given_turn(h) - first_turn);
    const Eigen::Matrix3d R =
        rotation_or(first.transpose() * motions[size_t(h)].leftCols<3>(), turn);
    angles.row(h) = (turn + rotation_vector(rotation_by(-turn) * R)).transpose();
    if (group.fixed) largest_angle = std::max(largest_angle, angles.row(h).norm());
    for (int other : group.prescribed)
      if (other < h)
        largest_angle = std::max(largest_angle, (angles.row(h) - angles.row(other)).norm());
  }
  const double interpolated_fraction =
      std::clamp((largest_angle - kMinimizedUntil) / (kPi - kMinimizedUntil), 0.0, 1.0);
  for (int i : group.free) {
    const Eigen::Vector3d turn = (harmonic_weights_.row(i) * angles).transpose();
    result.rotations[size_t(i)] = first * rotation_by(turn);
    result.turns[size_t(i)] = first_turn + first * turn;
    result.interpolated_fractions[size_t(i)] = interpolated_fraction;
  }
}

void FreeTurns::find(std::vector<Affine>& motions, const Positions& pivots,
                     std::vector<double>& turns) const {
  const Interpolated start = interpolate(motions, pivots, turns);
  std::vector<Eigen::Matrix3d> initial = start.rotations;
  for (size_t i = 0; i < initial.size(); ++i)
    initial[i] = turned_like_an_arc(i, initial[i], motions,
                                    pivots.row(energy_.free_handles()[i]).transpose());
  const std::vector<Eigen::Matrix3d> minimizing = energy_.minimize(motions, pivots, initial);
  if (turns.empty()) turns.assign(3 * free().size(), 0.0);
  for (size_t i = 0; i < minimizing.size(); ++i) {
    const int h = energy_.free_handles()[i];
    const Eigen::Matrix3d& interpolated = start.rotations[i];
    const Eigen::Matrix3d R =
        interpolated * rotation_by((1 - start.interpolated_fractions[i]) *
                                   rotation_vector(interpolated.transpose() * minimizing[i]));
    rotate_about_pivot(R, pivots.row(h), motions[size_t(h)]);
    Eigen::Map<Eigen::Vector3d>(turns.data() + 3 * size_t(h)) =
        rotation_vector_near(Eigen::AngleAxisd(R), start.turns[i]);
  }
}

void FreeTurns::follow(const Rows& base, std::vector<Affine>& motions,
                       const Positions& pivots) const {
  const std::vector<Eigen::Matrix3d> rotations = energy_.rotations_of(base);
  for (size_t i = 0; i < rotations.size(); ++i) {
    const int h = energy_.free_handles()[i];
    rotate_about_pivot(rotations[i], pivots.row(h), motions[size_t(h)]);
  }
}

double FreeTurns::bytes() const {
  return energy_.bytes() + static_cast<double>(harmonic_weights_.size()) * sizeof(double);
}

}  // namespace dd
