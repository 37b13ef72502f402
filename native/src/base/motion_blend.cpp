// SPDX-License-Identifier: GPL-3.0-or-later
#include "base/motion_blend.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>

#include "reconstruction/whole_surface.h"
#include "support/rotations.h"

namespace dd {

namespace {

constexpr int kTermCount = 12 + 12 + 3 + 1;  // columns of handle_terms_
// Lower bound of a handle's radius, so that one of a single vertex has one: a fraction of √(area of
// S), which unlike the diagonal of the bounding box is invariant under rotation.
constexpr double kMinHandleRadius = 0.015;
// Angle of a handle from which on R is the gauge: well below 180°, where the sign of a quaternion
// becomes ambiguous.
constexpr double kGaugeFrom = kPi / 2;
// Largest angle up to which the base is the linear one: 135°, to which that, refined, stretches the
// survey's bar and cylinder less than the blend. From there to 180° the two are mixed.
constexpr double kLinearUntil = 0.75 * kPi;
// Fraction of the refinement that is applied: 1 to kLinearUntil, kRefinedAtHalfTurn at 180°, 0 from
// kRefinedUntil (630°) on, linear in between. More would pinch the inside of a bend and make a
// twist thin.
constexpr double kRefinedUntil = 3.5 * kPi;
constexpr double kRefinedAtHalfTurn = 0.7;
// Sum of harmonic weights below which a point has no centre to turn about: no handle reaches it.
constexpr double kMinWeightSum = 1e-12;

/// The largest distance between any two points.
double diameter(const std::vector<Eigen::Vector3d>& points) {
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) mean += point / static_cast<double>(points.size());
  // Pairs in descending distance from the mean m: |a − b| ≤ |a − m| + |b − m| ends the search
  // early.
  std::vector<std::pair<double, size_t>> from_mean;
  from_mean.reserve(points.size());
  for (size_t i = 0; i < points.size(); ++i) from_mean.emplace_back((points[i] - mean).norm(), i);
  std::sort(from_mean.rbegin(), from_mean.rend());
  double largest = 0;
  for (size_t i = 1; i < from_mean.size() && from_mean[i].first + from_mean[0].first > largest; ++i)
    for (size_t j = 0; j < i && from_mean[i].first + from_mean[j].first > largest; ++j)
      largest =
          std::max(largest, (points[from_mean[i].second] - points[from_mean[j].second]).norm());
  return largest;
}

/// s_h = cos²(angle/2): the fraction of a handle's linear displacement that is kept.
double kept_fraction(double angle) { return angle < kPi ? 0.5 * (1 + std::cos(angle)) : 0; }

/// A handle's factor of λ: 1 while its centre moves perpendicular to its axis by less than 2 radii,
/// 0 from 4 radii on. turn: its rotation vector. shift: displacement of its centre. Below 45° the
/// effect fades with the angle: for small rotations E and P agree.
double twist_fraction_of(const Eigen::Vector3d& turn, const Eigen::Vector3d& shift, double radius) {
  const double angle = turn.norm();
  if (angle == 0) return 1;
  const double sideways = (shift - turn * (turn.dot(shift) / (angle * angle))).norm();
  // Written so that veto is 1 also if sideways overflows to infinity or NaN.
  const double veto = sideways < 4 * radius ? std::max(0.5 * sideways / radius - 1, 0.0) : 1;
  return 1 - veto * std::min(1.0, 4 * angle / kPi);
}

}  // namespace

MotionBlend::MotionBlend(const BoundSurface& bound)
    : bound_(bound),
      handle_terms_(RowMatrix::Zero(bound.region.handle_count, kTermCount)),
      coefficients_(RowMatrix::Zero(4 * bound.region.handle_count, 4)) {
  const Region& region = bound.region;
  std::vector<double> squares(size_t(region.handle_count), 0.0);
  std::vector<int> counts(squares.size(), 0);
  for (int v : region.handle_vertices) {
    const int h = region.role[v];
    squares[h] += (bound.mesh.positions.row(v) - bound.coordinates.centres().row(h)).squaredNorm();
    ++counts[h];
  }
  const double min_radius = kMinHandleRadius * std::sqrt(whole_area(bound));
  for (size_t h = 0; h < squares.size(); ++h)
    radii_.push_back(std::max(min_radius, std::sqrt(squares[h] / counts[h])));
}

HarmonicBlend& MotionBlend::harmonic() {
  if (!harmonic_) harmonic_ = std::make_unique<HarmonicBlend>(bound_);
  return *harmonic_;
}

void MotionBlend::set_pose(const std::vector<Affine>& motions, const std::vector<double>& turns) {
  const bool fixed = bound_.order().count() > bound_.order().fixed_begin;
  const auto given_turn = [&](size_t h) -> Eigen::Vector3d {
    if (turns.empty()) return Eigen::Vector3d::Zero();
    return Eigen::Map<const Eigen::Vector3d>(turns.data() + 3 * h);
  };
  for (size_t h = 0; h < motions.size(); ++h)
    if (!given_turn(h).allFinite())
      throw Error(Status::argument, {Subject::handle, Index(h)}, "has a turn that is not finite",
                  Remedy::call);

  const auto centre = [&](size_t h) -> Eigen::Vector3d {
    return bound_.coordinates.centres().row(Index(h)).transpose();
  };
  Eigen::Vector3d reference_turn = Eigen::Vector3d::Zero();
  reference_shift_.setZero();
  reference_.setIdentity();
  if (!fixed && !motions.empty()) {
    reference_turn = given_turn(0);
    reference_ = rotation_or(motions[0].leftCols<3>(), reference_turn);
    reference_shift_ =
        motions[0].leftCols<3>() * centre(0) + motions[0].col(3) - reference_ * centre(0);
  }
  turns_.reference = reference_;
  turns_.vectors.resize(Index(motions.size()), 6);
  rotations_blended_ = false;
  largest_angle_ = 0;
  twist_fraction_ = 1;
  std::vector<Eigen::Vector3d> angles;
  if (fixed) angles.push_back(Eigen::Vector3d::Zero());
  for (size_t h = 0; h < motions.size(); ++h) {
    const Eigen::Matrix3d A = reference_.transpose() * motions[h].leftCols<3>();
    const Eigen::Vector3d shift = reference_.transpose() * (motions[h].col(3) - reference_shift_);
    const Eigen::Vector3d turn = reference_.transpose() * (given_turn(h) - reference_turn);
    const Eigen::Vector3d rest = rotation_vector(rotation_by(-turn) * rotation_or(A, turn));
    angles.push_back(turn + rest);
    largest_angle_ = std::max(largest_angle_, turn.norm() + rest.norm() + reference_turn.norm());
    const double kept = kept_fraction(angles.back().norm());
    Affine change;
    change << A - Eigen::Matrix3d::Identity(), shift;
    auto row = handle_terms_.row(Index(h));
    turns_.vectors.row(Index(h)) << turn.transpose(), rest.transpose();
    for (int k = 0; k < 3; ++k) {
      row.segment<4>(4 * k) = kept * change.row(k);
      row.segment<4>(12 + 4 * k) = change.row(k);
    }
    const Eigen::Vector3d moved = change.leftCols<3>() * centre(h) + change.col(3);
    row.segment<3>(24) = centre(h).transpose();
    row[27] = 1;
    twist_fraction_ *= twist_fraction_of(angles.back(), moved, radii_[h]);
    auto block = coefficients_.middleRows<4>(4 * Index(h));
    block.topLeftCorner<3, 3>() = kept * change.leftCols<3>().transpose();
    block.bottomLeftCorner<1, 3>() = kept * moved.transpose();
  }
  largest_relative_angle_ = diameter(angles);
}

double MotionBlend::blend_fraction(BaseDeformer deformer) const {
  if (deformer == BaseDeformer::motions) return 1;
  if (deformer == BaseDeformer::linear) return 0;
  return std::clamp((largest_relative_angle_ - kLinearUntil) / (kPi - kLinearUntil), 0.0, 1.0);
}

void MotionBlend::blend_rotations() {
  if (rotations_blended_) return;
  const RowOrder& order = bound_.order();
  HarmonicBlend& harmonic = this->harmonic();
  harmonic.set_values(turns_.vectors);
  if (rotations_.rows() == 0) {
    rotations_ = Rows::Zero(order.count(), 4);
    rotations_.col(3).setOnes();
  }
  const auto set_rotation = [&](int64_t row, const double* term) {
    rotations_.row(row) = turns_.rotation(term).coeffs().transpose();
  };
  bound_.poisson->pool().parallel_for(order.free_count, kLeastRange,
                                      [&](int64_t begin, int64_t end) {
                                        const RowMatrix blended = harmonic.rows(begin, end);
                                        for (int64_t r = begin; r < end; ++r)
                                          set_rotation(r, blended.row(r - begin).data());
                                      });
  for (int r = order.free_count; r < order.fixed_begin; ++r)
    set_rotation(r, turns_.vectors.row(bound_.region.role[order.vertex_of_row[r]]).data());
  rotations_blended_ = true;
}

void MotionBlend::blend_into(const Rows& displacement, double fraction, Rows& base) {
  blend_rotations();
  if (!of_base_) of_base_ = std::make_unique<RotatedFlux>(bound_, bound_.base, rotations_);
  solved_ = displacement;
  bound_.poisson->solve(
      of_base_->at_rest(), [&](int section, double* rows) { of_base_->add(section, rows); },
      solved_);
  HarmonicBlend& harmonic = this->harmonic();
  harmonic.set_values(handle_terms_);
  kept_displacement_.setZero(bound_.order().free_count, 4);
  bound_.extension.displace(coefficients_, kept_displacement_, kept_displacement_);  // Σ s W C
  const Eigen::Quaterniond first(reference_);
  bound_.poisson->pool().parallel_for(
      kept_displacement_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
        const RowMatrix terms = harmonic.rows(begin, end);
        for (int64_t i = 0; i < end - begin; ++i) {
          const double* term = terms.row(i).data();
          const auto displaced_by = [&](int k, const Eigen::Vector3d& x) -> Eigen::Vector3d {
            const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> change(term + k);
            return change.leftCols<3>() * x + change.col(3);
          };
          const Eigen::Vector3d rest = bound_.rest_base.row(begin + i).head<3>();
          // Σ s W C − Σ s a (M q − q).
          const Eigen::Vector3d linear_remainder =
              Eigen::Vector3d(kept_displacement_.row(begin + i).head<3>()) - displaced_by(0, rest);
          Eigen::Vector3d blended = rest + Eigen::Vector3d(solved_.row(begin + i).head<3>());
          if (twist_fraction_ > 0) {
            Eigen::Vector3d twisted = rest;  // if the harmonic weights vanish
            if (term[27] > kMinWeightSum) {
              const Eigen::Vector3d centre =
                  Eigen::Map<const Eigen::Vector3d>(term + 24) / term[27];
              twisted = centre + displaced_by(12, centre) +
                        first.conjugate() * (quaternion(rotations_, begin + i) * (rest - centre));
            }
            blended += twist_fraction_ * (reference_ * twisted + reference_shift_ - blended);
          }
          auto row = base.row(begin + i).head<3>();
          row += fraction * ((blended + reference_ * linear_remainder).transpose() - row);
        }
      });
}

Turning MotionBlend::turning(BaseDeformer deformer) {
  Turning result;
  result.handles = &turns_;
  result.prescribed_weight = blend_fraction(deformer) * (1 - twist_fraction_);
  if (largest_angle_ <= kGaugeFrom && result.prescribed_weight == 0) return result;
  blend_rotations();
  if (largest_angle_ > kGaugeFrom) result.gauge = &rotations_;
  result.gauge_weight =
      std::clamp((largest_angle_ - kGaugeFrom) / (kLinearUntil - kGaugeFrom), 0.0, 1.0);
  if (result.prescribed_weight > 0) {
    if (!of_surface_)
      of_surface_ = std::make_unique<RotatedFlux>(bound_, bound_.mesh.positions, rotations_);
    result.prescribed = of_surface_.get();
    result.prescribed_rotations = &rotations_;
  }
  const auto ramp_down = [&](double begin, double end) {
    return std::clamp((end - largest_relative_angle_) / (end - begin), 0.0, 1.0);
  };
  result.refinement_weight = largest_relative_angle_ < kPi
                                 ? 1 - (1 - kRefinedAtHalfTurn) * (1 - ramp_down(kLinearUntil, kPi))
                                 : kRefinedAtHalfTurn * ramp_down(kPi, kRefinedUntil);
  return result;
}

double MotionBlend::bytes() const {
  const auto doubles = kept_displacement_.size() + handle_terms_.size() + coefficients_.size() +
                       solved_.size() + rotations_.size();
  return static_cast<double>(doubles) * sizeof(double) + (harmonic_ ? harmonic_->bytes() : 0) +
         (of_base_ ? of_base_->bytes() : 0) + (of_surface_ ? of_surface_->bytes() : 0);
}

}  // namespace dd
