// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/example_pass.h"

#include <algorithm>
#include <cmath>

#include "support/rotations.h"

namespace dd {

namespace {

constexpr int kMostChunks = 64;
constexpr int kLeastChunk = 8;      // blocks that are worth a task
constexpr double kSmallTurn = 0.1;  // squared: below, series are better than quotients

/// The factors of exp r = I + sine [r]× + versine [r]×² and of its left Jacobian
/// I + versine [r]× + cubic [r]×².
struct TurnFactors {
  double sine, versine, cubic;
};

TurnFactors turn_factors(double x) {  // squared length of r
  if (x < kSmallTurn)
    return {1 - x / 6 * (1 - x / 20 * (1 - x / 42 * (1 - x / 72 * (1 - x / 110)))),
            0.5 * (1 - x / 12 * (1 - x / 30 * (1 - x / 56 * (1 - x / 90 * (1 - x / 132))))),
            1.0 / 6 * (1 - x / 20 * (1 - x / 42 * (1 - x / 72 * (1 - x / 110 * (1 - x / 156)))))};
  const double angle = std::sqrt(x), sine = std::sin(angle), cosine = std::cos(angle);
  return {sine / angle, (1 - cosine) / x, (angle - sine) / (x * angle)};
}

}  // namespace

template <class Real>
ExamplePass<Real>::ExamplePass(const ExampleSurface& of, const PoissonSystem& poisson)
    : poisson_(poisson),
      example_count_(static_cast<int>(of.examples.size())),
      layout_(poisson.active()),
      blocks_(layout_.without_targets<Block>(poisson)) {
  const Triangles& t = of.surface.operators.triangles;
  for (Block& block : blocks_) {
    for (auto& corner : block.corner)
      for (int32_t& row : corner) row = 0;
    block.a = block.b = block.c = Lanes::Zero();
    block.rest.fill(Lanes::Zero());
  }
  Change none;
  none.turn.fill(Lanes::Zero());
  none.stretch.fill(Lanes::Zero());
  changes_.assign(blocks_.size() * size_t(example_count_), none);
  Pose still;
  still.turn.fill(Lanes::Zero());
  still.sine = still.versine = still.cubic = Lanes::Zero();
  still.moved = still.whole = none.stretch;
  still.rotation_only = false;
  pose_.assign(blocks_.size(), still);
  misfit_.assign(blocks_.size(), none.stretch);

  layout_.each(poisson.active(), [&](int place, int section, int b, int lane) {
    const int j = poisson.active().triangles[place];
    Block& block = blocks_[b];
    const auto cotangents = of.surface.operators.metric.cotangents.row(j);
    const double a = std::sqrt(0.5 * (cotangents[1] + cotangents[2]));
    const double skew = -0.5 * cotangents[2] / a, c = 0.5 / a;
    block.a[lane] = static_cast<Real>(a);
    block.b[lane] = static_cast<Real>(skew);
    block.c[lane] = static_cast<Real>(c);
    for (int k = 0; k < 3; ++k) {
      block.corner[k][lane] = poisson.order().row_of_vertex[t(j, k)];
      block.target[k][lane] = poisson.target(section, t(j, k));
    }
    using InPlane = Eigen::Matrix<double, 3, 2>;
    const auto in_plane = [&](const Positions& x) {
      const Eigen::Vector3d first = x.row(t(j, 0)) - x.row(t(j, 2));
      const Eigen::Vector3d second = x.row(t(j, 1)) - x.row(t(j, 2));
      InPlane columns;
      columns << a * first + skew * second, c * second;
      return columns;
    };
    const auto put = [lane](Gradient& gradient, const InPlane& columns) {
      for (int k = 0; k < 6; ++k)
        gradient[size_t(k)][lane] = static_cast<Real>(columns(k % 3, k / 3));
    };
    const InPlane rest = in_plane(of.surface.mesh.positions);
    put(block.rest, rest);
    for (int i = 0; i < example_count_; ++i) {
      Change& change = changes_[size_t(b) * size_t(example_count_) + size_t(i)];
      const Eigen::Vector3d turn = of.turns.at(i, j);
      for (int k = 0; k < 3; ++k) change.turn[size_t(k)][lane] = static_cast<Real>(turn[k]);
      // Whatever the turn, what it leaves of the example's own gradient.
      put(change.stretch, rotation_by(-turn) * in_plane(of.examples[size_t(i)]) - rest);
    }
  });
}

template <class Real>
int ExamplePass<Real>::chunk_count() const {
  return std::clamp(layout_.count() / kLeastChunk, 1, kMostChunks);
}

template <class Real>
template <class Body>
void ExamplePass<Real>::by_chunks(const Body& body) const {
  const int chunks = chunk_count();
  poisson_.pool().run(chunks, [&](int chunk) {
    const auto at = [&](int64_t k) { return static_cast<int>(layout_.count() * k / chunks); };
    for (int b = at(chunk); b < at(chunk + 1); ++b) body(b, chunk);
  });
}

template <class Real>
typename ExamplePass<Real>::Gradient ExamplePass<Real>::gradient(const Block& block,
                                                                 const Rows& x) const {
  Vector first, second;
  for (int lane = 0; lane < kLanes; ++lane) {
    const double* x0 = x.data() + 4 * static_cast<int64_t>(block.corner[0][lane]);
    const double* x1 = x.data() + 4 * static_cast<int64_t>(block.corner[1][lane]);
    const double* x2 = x.data() + 4 * static_cast<int64_t>(block.corner[2][lane]);
    for (size_t c = 0; c < 3; ++c) {
      first[c][lane] = static_cast<Real>(x0[c] - x2[c]);
      second[c][lane] = static_cast<Real>(x1[c] - x2[c]);
    }
  }
  Gradient result;
  for (size_t c = 0; c < 3; ++c) {
    result[c] = block.a * first[c] + block.b * second[c];
    result[3 + c] = block.c * second[c];
  }
  return result;
}

template <class Real>
void ExamplePass<Real>::add_divergence(const Block& block, const Gradient& X,
                                       const int32_t (*to)[kLanes], double* rows) {
  Vector first, second;
  for (size_t c = 0; c < 3; ++c) {
    first[c] = block.a * X[c];
    second[c] = block.b * X[c] + block.c * X[3 + c];
  }
  for (int lane = 0; lane < kLanes; ++lane) {
    double* r0 = rows + 4 * static_cast<int64_t>(to[0][lane]);
    double* r1 = rows + 4 * static_cast<int64_t>(to[1][lane]);
    double* r2 = rows + 4 * static_cast<int64_t>(to[2][lane]);
    for (size_t c = 0; c < 3; ++c) {
      r0[c] += first[c][lane];
      r1[c] += second[c][lane];
      r2[c] -= first[c][lane] + second[c][lane];
    }
  }
}

template <class Real>
void ExamplePass<Real>::pose(int section, const Eigen::VectorXd& weights, bool rotation_only,
                             double* rows) {
  for (int b = layout_.begin[section]; b < layout_.begin[section + 1]; ++b) {
    const Block& block = blocks_[b];
    const Change* changes = changes_.data() + Index(b) * example_count_;
    Pose pose = {};
    pose.turn.fill(Lanes::Zero());
    pose.moved.fill(Lanes::Zero());
    pose.rotation_only = rotation_only;
    for (int i = 0; i < example_count_; ++i) {
      const Real w = static_cast<Real>(weights[i]);
      if (w == 0) continue;
      for (size_t c = 0; c < 3; ++c) pose.turn[c] += w * changes[i].turn[c];
      if (rotation_only) continue;
      for (size_t c = 0; c < 6; ++c) pose.moved[c] += w * changes[i].stretch[c];
    }
    const Lanes squares = pose.turn[0].square() + pose.turn[1].square() + pose.turn[2].square();
    for (int lane = 0; lane < kLanes; ++lane) {
      const TurnFactors factors = turn_factors(static_cast<double>(squares[lane]));
      pose.sine[lane] = static_cast<Real>(factors.sine);
      pose.versine[lane] = static_cast<Real>(factors.versine);
      pose.cubic[lane] = static_cast<Real>(factors.cubic);
    }
    Gradient stretched;
    for (size_t c = 0; c < 6; ++c) stretched[c] = block.rest[c] + pose.moved[c];
    add_turned(pose.turn, pose.sine, pose.versine, stretched, pose.moved);
    for (size_t c = 0; c < 6; ++c) pose.whole[c] = block.rest[c] + pose.moved[c];
    add_divergence(block, pose.moved, block.target, rows);
    pose_[b] = pose;
  }
}

template <class Real>
double ExamplePass<Real>::size() const {
  std::vector<double> sums(size_t(chunk_count()), 0);
  by_chunks([&](int b, int chunk) {
    for (const Lanes& x : pose_[b].moved) sums[chunk] += x.square().sum();
  });
  double sum = 0;
  for (double part : sums) sum += part;
  return sum;
}

template <class Real>
double ExamplePass<Real>::misfit(const Rows& offsets) {
  std::vector<double> sums(size_t(chunk_count()), 0);
  by_chunks([&](int b, int chunk) {
    const Gradient reached = gradient(blocks_[b], offsets);
    Lanes squares = Lanes::Zero();
    for (size_t c = 0; c < 6; ++c) {
      misfit_[b][c] = pose_[b].moved[c] - reached[c];
      squares += misfit_[b][c].square();
    }
    sums[chunk] += squares.sum();
  });
  double sum = 0;
  for (double part : sums) sum += part;
  return sum;
}

template <class Real>
Rows ExamplePass<Real>::misfit_divergence(int row_count) const {
  Rows rows = Rows::Zero(row_count, 4);
  for (size_t b = 0; b < blocks_.size(); ++b)
    add_divergence(blocks_[b], misfit_[b], blocks_[b].corner, rows.data());
  return rows;
}

template <class Real>
typename ExamplePass<Real>::Vector ExamplePass<Real>::spin(const Pose& pose, const Vector& by) {
  const Vector once = cross(pose.turn, by[0], by[1], by[2]);
  const Vector twice = cross(pose.turn, once[0], once[1], once[2]);
  Vector spin;
  for (size_t c = 0; c < 3; ++c) spin[c] = by[c] + pose.versine * once[c] + pose.cubic * twice[c];
  return spin;
}

template <class Real>
void ExamplePass<Real>::slope(int example, int section, double* rows) {
  for (int b = layout_.begin[section]; b < layout_.begin[section + 1]; ++b) {
    const Pose& pose = pose_[b];
    const size_t place = size_t(b) * size_t(example_count_) + size_t(example);
    const Change& change = changes_[place];
    const Vector spins = spin(pose, change.turn);
    Gradient slope;
    for (size_t column = 0; column < 6; column += 3) {
      const Vector spun =
          cross(spins, pose.whole[column], pose.whole[column + 1], pose.whole[column + 2]);
      for (size_t c = 0; c < 3; ++c) slope[column + c] = spun[c];
    }
    if (!pose.rotation_only) {
      for (size_t c = 0; c < 6; ++c) slope[c] += change.stretch[c];
      add_turned(pose.turn, pose.sine, pose.versine, change.stretch, slope);
    }
    slopes_[place] = slope;
    add_divergence(blocks_[b], slope, blocks_[b].target, rows);
  }
}

template <class Real>
void ExamplePass<Real>::project(int example, const Rows& offsets) {
  by_chunks([&](int b, int) {
    const Gradient reached = gradient(blocks_[b], offsets);
    Gradient& slope = slopes_[size_t(b) * size_t(example_count_) + size_t(example)];
    for (size_t c = 0; c < 6; ++c) slope[c] -= reached[c];
  });
}

template <class Real>
void ExamplePass<Real>::second_order(Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient) const {
  // Of each chunk, in every lane: for each example its row up to the diagonal, then its gradient.
  const size_t count = size_t(example_count_), row = count * (count + 3) / 2;
  std::vector<Lanes> sums(size_t(chunk_count()) * row, Lanes::Zero());
  std::vector<Bend> bends(size_t(chunk_count()) * count);
  by_chunks([&](int b, int chunk) {
    Lanes* sum = sums.data() + size_t(chunk) * row;
    Bend* bend = bends.data() + size_t(chunk) * count;
    const Gradient* slopes = slopes_.data() + size_t(b) * count;
    take_bends(b, bend);
    for (size_t i = 0; i < count; ++i) {
      for (size_t k = 0; k <= i; ++k)
        *sum++ += dot(slopes[i], slopes[k]) + dot(bend[k].spin, bend[i].pull) +
                  dot(bend[i].spin, bend[k].stretch_pull);
      *sum++ += dot(slopes[i], misfit_[b]);
    }
  });
  hessian.setZero(example_count_, example_count_);
  gradient.setZero(example_count_);
  for (int chunk = 0; chunk < chunk_count(); ++chunk) {
    const Lanes* sum = sums.data() + size_t(chunk) * row;
    for (int i = 0; i < example_count_; ++i) {
      for (int k = 0; k <= i; ++k) hessian(i, k) += (sum++)->template cast<double>().sum();
      gradient[i] += (sum++)->template cast<double>().sum();
    }
  }
  hessian.template triangularView<Eigen::StrictlyUpper>() = hessian.transpose();
}

/// With T'' to second order in spins, and the spins' own derivative left out, which vanishes where
/// the examples turn about one axis: r · T''_ik = a_iᵀ K a_k + a_i · t_k + t_i · a_k.
template <class Real>
void ExamplePass<Real>::take_bends(int b, Bend* bends) const {
  const Pose& pose = pose_[b];
  const Gradient& misfit = misfit_[b];
  std::array<Vector, 3> K;
  for (size_t p = 0; p < 3; ++p)
    for (size_t q = 0; q < 3; ++q)
      K[p][q] = Real(0.5) * (misfit[p] * pose.whole[q] + misfit[q] * pose.whole[p] +
                             misfit[3 + p] * pose.whole[3 + q] + misfit[3 + q] * pose.whole[3 + p]);
  const Lanes trace = K[0][0] + K[1][1] + K[2][2];
  for (size_t p = 0; p < 3; ++p) K[p][p] -= trace;
  for (int i = 0; i < example_count_; ++i) {
    const Change& change = changes_[size_t(b) * size_t(example_count_) + size_t(i)];
    Bend& bend = bends[i];
    bend.spin = spin(pose, change.turn);
    bend.stretch_pull.fill(Lanes::Zero());
    if (!pose.rotation_only) {
      Gradient turned = change.stretch;
      add_turned(pose.turn, pose.sine, pose.versine, change.stretch, turned);
      for (size_t column = 0; column < 6; column += 3) {
        const Vector pull = cross({turned[column], turned[column + 1], turned[column + 2]},
                                  misfit[column], misfit[column + 1], misfit[column + 2]);
        for (size_t c = 0; c < 3; ++c) bend.stretch_pull[c] += pull[c];
      }
    }
    for (size_t c = 0; c < 3; ++c) bend.pull[c] = dot(K[c], bend.spin) + bend.stretch_pull[c];
  }
}

template <class Real>
double ExamplePass<Real>::bytes() const {
  return static_cast<double>(blocks_.size() * sizeof(Block) + changes_.size() * sizeof(Change) +
                             pose_.size() * sizeof(Pose) +
                             (misfit_.size() + slopes_.size()) * sizeof(Gradient));
}

template class ExamplePass<float>;
template class ExamplePass<double>;

}  // namespace dd
