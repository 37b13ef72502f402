// SPDX-License-Identifier: GPL-3.0-or-later
// The passes of posing by example, included once for each instruction set: see kernels_impl.h, and
// ExamplePass for their definitions.
#pragma once

#include "kernels/kernels_triangles.h"

namespace dd {

namespace {

/// A value for each triangle of a block. An Eigen array, as compilers don't vectorize plain loops
/// over lanes with bodies as long as these.
template <class Real>
using InLanes = Eigen::Array<Real, kLanes, 1>;

template <class Real>
struct Three {
  InLanes<Real> x, y, z;
};
template <class Real>
inline Three<Real> operator+(const Three<Real>& u, const Three<Real>& v) {
  return {u.x + v.x, u.y + v.y, u.z + v.z};
}
template <class Real>
inline InLanes<Real> dot(const Three<Real>& u, const Three<Real>& v) {
  return u.x * v.x + u.y * v.y + u.z * v.z;
}
template <class Real>
inline Three<Real> cross(const Three<Real>& u, const Three<Real>& v) {
  return {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
}
/// (a [r]× + b [r]×²) v, which is (exp r − I) v for a = sin |r| / |r|, b = (1 − cos |r|) / |r|².
template <class Real>
inline Three<Real> rotated_by(const Three<Real>& r, const InLanes<Real>& a, const InLanes<Real>& b,
                              const Three<Real>& v) {
  const Three<Real> once = cross(r, v), twice = cross(r, once);
  return {a * once.x + b * twice.x, a * once.y + b * twice.y, a * once.z + b * twice.z};
}

template <class Real>
inline Eigen::Map<const InLanes<Real>> in_lanes(const Real (&lanes)[kLanes]) {
  return Eigen::Map<const InLanes<Real>>(lanes);
}
template <class Real>
inline Eigen::Map<InLanes<Real>> in_lanes(Real (&lanes)[kLanes]) {
  return Eigen::Map<InLanes<Real>>(lanes);
}
template <class Real>
inline Three<Real> three(const Real (*lanes)[kLanes]) {
  return {in_lanes(lanes[0]), in_lanes(lanes[1]), in_lanes(lanes[2])};
}
template <class Real>
inline void put(Real (*lanes)[kLanes], const Three<Real>& v) {
  in_lanes(lanes[0]) = v.x, in_lanes(lanes[1]) = v.y, in_lanes(lanes[2]) = v.z;
}

/// The coefficients of exp r = I + sine [r]× + versine [r]×² and of its left Jacobian
/// I + versine [r]× + cubic [r]×².
template <class Real>
inline void take_factors(ExamplePose<Real>& pose) {
  // Squared angle in rad² below which Taylor series replace quotients, which cancel there. Derived:
  // up to it the series' remainders are below 2e-16.
  constexpr double kTaylorLimit = 0.1;
  const Three<Real> r = three<Real>(pose.turn);
  const InLanes<Real> squares = dot(r, r);
  for (int lane = 0; lane < kLanes; ++lane) {
    const double x = static_cast<double>(squares[lane]);
    double sine, versine, cubic;
    if (x < kTaylorLimit) {
      sine = 1 - x / 6 * (1 - x / 20 * (1 - x / 42 * (1 - x / 72 * (1 - x / 110))));
      versine = 0.5 * (1 - x / 12 * (1 - x / 30 * (1 - x / 56 * (1 - x / 90 * (1 - x / 132)))));
      cubic = 1.0 / 6 * (1 - x / 20 * (1 - x / 42 * (1 - x / 72 * (1 - x / 110 * (1 - x / 156)))));
    } else {
      const double angle = sqrt(x), of_sine = sin(angle);
      sine = of_sine / angle;
      versine = (1 - cos(angle)) / x;
      cubic = (angle - of_sine) / (x * angle);
    }
    pose.sine[lane] = static_cast<Real>(sine);
    pose.versine[lane] = static_cast<Real>(versine);
    pose.cubic[lane] = static_cast<Real>(cubic);
  }
}

/// An ExamplePose in registers.
template <class Real>
struct PoseInLanes {
  explicit PoseInLanes(const ExamplePose<Real>& pose)
      : turn(three<Real>(pose.turn)),
        sine(in_lanes(pose.sine)),
        versine(in_lanes(pose.versine)),
        cubic(in_lanes(pose.cubic)) {}
  /// exp(r) v − v, by which the pose's rotation moves v.
  Three<Real> moved(const Three<Real>& v) const { return rotated_by(turn, sine, versine, v); }
  /// If the rotation vector r changes by dr, the rotation changes by d exp(r) = [a]× exp(r) with
  /// this a, the left Jacobian of the exponential map times dr.
  Three<Real> spin(const Three<Real>& dr) const {
    return dr + rotated_by(turn, versine, cubic, dr);
  }
  Three<Real> turn;
  InLanes<Real> sine, versine, cubic;
};

template <class Real>
inline void add_divergence(const ExampleBlock<Real>& block, const Real (*gradient)[kLanes],
                           const int32_t (&to)[3][kLanes], double* rows) {
  Real flux[2][3][kLanes];
  for (int c = 0; c < 3; ++c) {
    const auto first = in_lanes(gradient[c]), second = in_lanes(gradient[3 + c]);
    in_lanes(flux[0][c]) = in_lanes(block.a) * first;
    in_lanes(flux[1][c]) = in_lanes(block.b) * first + in_lanes(block.c) * second;
  }
  scatter(to, flux, rows);
}

/// gradient −= √A_j G_j(x).
template <class Real>
inline void subtract_gradient(const ExampleBlock<Real>& block, const double* x,
                              Real (*gradient)[kLanes]) {
  TriangleEdges<Real> edges;
  gather_edges(block.corner, x, edges);
  for (int c = 0; c < 3; ++c) {
    const auto first = in_lanes<Real>(edges.first[c]), second = in_lanes<Real>(edges.second[c]);
    in_lanes(gradient[c]) -= in_lanes(block.a) * first + in_lanes(block.b) * second;
    in_lanes(gradient[3 + c]) -= in_lanes(block.c) * second;
  }
}

template <class Real>
void example_pose(const ExampleView<Real>& view, int begin, int end, const Real* weights,
                  bool rotation_only, double* rows) {
  for (int b = begin; b < end; ++b) {
    const ExampleBlock<Real>& block = view.blocks[b];
    const ExampleChange<Real>* change = view.changes + int64_t{b} * view.example_count;
    ExamplePose<Real>& pose = view.poses[b];
    pose.rotation_only = rotation_only;
    InLanes<Real> turn[3], stretch[6];
    for (auto& lanes : turn) lanes.setZero();
    for (auto& lanes : stretch) lanes.setZero();
    for (int i = 0; i < view.example_count; ++i, ++change) {
      const Real w = weights[i];
      if (w == 0) continue;
      for (int c = 0; c < 3; ++c) turn[c] += w * in_lanes(change->turn[c]);
      if (rotation_only) continue;
      for (int c = 0; c < 6; ++c) stretch[c] += w * in_lanes(change->stretch[c]);
    }
    for (int c = 0; c < 3; ++c) in_lanes(pose.turn[c]) = turn[c];
    take_factors(pose);
    const PoseInLanes<Real> in(pose);
    for (int column = 0; column < 6; column += 3) {
      const Three<Real> rest = three<Real>(block.rest + column);
      const Three<Real> own = {stretch[column], stretch[column + 1], stretch[column + 2]};
      const Three<Real> changed = own + in.moved(rest + own);
      put(pose.change + column, changed);
      put(pose.gradient + column, rest + changed);
    }
    add_divergence<Real>(block, pose.change, block.target, rows);
  }
}

template <class Real>
double example_misfit(const ExampleView<Real>& view, int begin, int end, const double* offsets) {
  double sum = 0;
  for (int b = begin; b < end; ++b) {
    Real(*misfit)[kLanes] = view.misfits[b].value;
    memcpy(misfit, view.poses[b].change, sizeof view.poses[b].change);
    subtract_gradient(view.blocks[b], offsets, misfit);
    InLanes<Real> squares = InLanes<Real>::Zero();
    for (int c = 0; c < 6; ++c) squares += in_lanes(misfit[c]).square();
    sum += static_cast<double>(squares.sum());
  }
  return sum;
}

template <class Real>
void example_misfit_divergence(const ExampleView<Real>& view, int begin, int end, double* rows) {
  for (int b = begin; b < end; ++b) {
    const ExampleBlock<Real>& block = view.blocks[b];
    int32_t to[3][kLanes];
    for (int k = 0; k < 3; ++k) memcpy(to[k], block.corner[(k + 1) % 3], sizeof to[k]);
    add_divergence<Real>(block, view.misfits[b].value, to, rows);
  }
}

template <class Real>
void example_derivative(const ExampleView<Real>& view, int example, int begin, int end,
                        double* rows) {
  for (int b = begin; b < end; ++b) {
    const ExamplePose<Real>& pose = view.poses[b];
    const PoseInLanes<Real> in(pose);
    const int64_t entry = int64_t{b} * view.example_count + example;
    const ExampleChange<Real>& change = view.changes[entry];
    Real(*derivative)[kLanes] = view.derivatives[entry].value;
    const Three<Real> spin = in.spin(three<Real>(change.turn));
    for (int column = 0; column < 6; column += 3) {
      const Three<Real> spun = cross(spin, three<Real>(pose.gradient + column));
      if (pose.rotation_only) {
        put(derivative + column, spun);
        continue;
      }
      const Three<Real> stretch = three<Real>(change.stretch + column);
      put(derivative + column, spun + (stretch + in.moved(stretch)));
    }
    add_divergence<Real>(view.blocks[b], derivative, view.blocks[b].target, rows);
  }
}

/// The second derivatives of the gradients T(w) by the weights of examples i and k, multiplied by
/// the misfit f and summed,
///
///   f · T''_ik = a_iᵀ K a_k + a_i · t_k + t_i · a_k,   K = ½ Σ (f_c g_cᵀ + g_c f_cᵀ) − tr(·) I,
///   t_i = Σ (exp(r) s_ic) × f_c,
///
/// where a_i is the spin() by example i, f_c and g_c are the columns of f and of the pose's
/// gradient, and s_ic those of example i's stretch. Neglects the derivatives of a_i, which vanish
/// if all examples turn about one axis.
template <class Real>
inline void take_second_order(const ExampleView<Real>& view, int b,
                              ExampleSecondOrder<Real>* second_order) {
  const ExamplePose<Real>& pose = view.poses[b];
  const PoseInLanes<Real> in(pose);
  const Real(*misfit)[kLanes] = view.misfits[b].value;
  InLanes<Real> K[3][3];
  for (int p = 0; p < 3; ++p)
    for (int q = 0; q < 3; ++q)
      K[p][q] = Real(0.5) * (in_lanes(misfit[p]) * in_lanes(pose.gradient[q]) +
                             in_lanes(misfit[q]) * in_lanes(pose.gradient[p]) +
                             in_lanes(misfit[3 + p]) * in_lanes(pose.gradient[3 + q]) +
                             in_lanes(misfit[3 + q]) * in_lanes(pose.gradient[3 + p]));
  const InLanes<Real> trace = K[0][0] + K[1][1] + K[2][2];
  for (int p = 0; p < 3; ++p) K[p][p] -= trace;
  const ExampleChange<Real>* change = view.changes + int64_t{b} * view.example_count;
  for (int i = 0; i < view.example_count; ++i, ++change) {
    const Three<Real> a = in.spin(three<Real>(change->turn));
    Three<Real> pull = {InLanes<Real>::Zero(), InLanes<Real>::Zero(), InLanes<Real>::Zero()};
    if (!pose.rotation_only)
      for (int column = 0; column < 6; column += 3) {
        const Three<Real> stretch = three<Real>(change->stretch + column);
        pull = pull + cross(stretch + in.moved(stretch), three<Real>(misfit + column));
      }
    put(second_order[i].spin, a);
    put(second_order[i].stretch_pull, pull);
    const auto row = [&](int p) -> InLanes<Real> {
      return K[p][0] * a.x + K[p][1] * a.y + K[p][2] * a.z;
    };
    put(second_order[i].pull, pull + Three<Real>{row(0), row(1), row(2)});
  }
}

template <class Real>
void example_second_order(const ExampleView<Real>& view, int begin, int end,
                          const double* const* position_responses,
                          ExampleSecondOrder<Real>* second_order, Real (*sums)[kLanes]) {
  const auto products = [](const ExampleGradient<Real>& x,
                           const ExampleGradient<Real>& y) -> InLanes<Real> {
    return dot(three<Real>(x.value), three<Real>(y.value)) +
           dot(three<Real>(x.value + 3), three<Real>(y.value + 3));
  };
  for (int b = begin; b < end; ++b) {
    take_second_order(view, b, second_order);
    ExampleGradient<Real>* derivatives = view.derivatives + int64_t{b} * view.example_count;
    for (int i = 0; i < view.example_count; ++i)
      subtract_gradient(view.blocks[b], position_responses[i], derivatives[i].value);
    Real(*sum)[kLanes] = sums;
    for (int i = 0; i < view.example_count; ++i) {
      for (int k = 0; k <= i; ++k)
        in_lanes(*sum++) +=
            products(derivatives[i], derivatives[k]) +
            dot(three<Real>(second_order[k].spin), three<Real>(second_order[i].pull)) +
            dot(three<Real>(second_order[i].spin), three<Real>(second_order[k].stretch_pull));
      in_lanes(*sum++) += products(derivatives[i], view.misfits[b]);
    }
  }
}

}  // namespace

}  // namespace dd
