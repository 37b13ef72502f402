// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/examples/example_pass.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "support/rotations.h"

namespace dd {

namespace {

constexpr int kMaxChunks = 64;      // limit on chunks, and so on the threads that share a pass
constexpr int kMinChunkBlocks = 8;  // blocks in a chunk: fewer aren't worth a task

}  // namespace

template <class Real>
ExamplePass<Real>::ExamplePass(const ExampleSurface& of, const PoissonSystem& poisson)
    : poisson_(poisson),
      example_count_(static_cast<int>(of.examples.size())),
      layout_(poisson.active()),
      blocks_(layout_.discarding_blocks<ExampleBlock<Real>>(poisson)) {
  const Triangles& t = of.surface.operators.triangles;
  const size_t count = blocks_.size();
  changes_.assign(count * size_t(example_count_), {});
  pose_.assign(count, {});
  misfit_.assign(count, {});
  layout_.each(poisson.active(), [&](int active_index, int section, int b, int lane) {
    const int j = poisson.active().triangles[active_index];
    ExampleBlock<Real>& block = blocks_[b];
    const auto cotangents = of.surface.operators.metric.cotangents.row(j);
    const Eigen::VectorXd& stiffness = of.surface.operators.stiffness;
    const double a = std::sqrt(0.5 * (cotangents[1] + cotangents[2]));
    const double skew = -0.5 * cotangents[2] / a;
    const double c = (stiffness.size() ? 0.5 * stiffness[j] : 0.5) / a;
    block.a[lane] = static_cast<Real>(a);
    block.b[lane] = static_cast<Real>(skew);
    block.c[lane] = static_cast<Real>(c);
    for (int k = 0; k < 3; ++k) {
      block.corner[(k + 1) % 3][lane] = poisson.order().row_of_vertex[t(j, k)];
      block.target[k][lane] = poisson.right_hand_side_row(section, t(j, k));
    }
    using InPlane = Eigen::Matrix<double, 3, 2>;
    const auto in_plane = [&](const Positions& x) {
      const Eigen::Vector3d first = x.row(t(j, 0)) - x.row(t(j, 2));
      const Eigen::Vector3d second = x.row(t(j, 1)) - x.row(t(j, 2));
      InPlane columns;
      columns << a * first + skew * second, c * second;
      return columns;
    };
    const auto store = [lane](Real(*gradient)[kLanes], const InPlane& columns) {
      for (int k = 0; k < 6; ++k) gradient[k][lane] = static_cast<Real>(columns(k % 3, k / 3));
    };
    const InPlane rest = in_plane(of.surface.mesh.positions);
    store(block.rest, rest);
    for (int i = 0; i < example_count_; ++i) {
      ExampleChange<Real>& change = changes_[size_t(b) * size_t(example_count_) + size_t(i)];
      const Eigen::Vector3d turn = of.logarithms.at(i, j);
      for (int k = 0; k < 3; ++k) change.turn[k][lane] = static_cast<Real>(turn[k]);
      // Exact for any chosen turn, though its exponential may not be the polar rotation.
      store(change.stretch, rotation_by(-turn) * in_plane(of.examples[size_t(i)]) - rest);
    }
  });
}

template <class Real>
int ExamplePass<Real>::chunk_count() const {
  return std::clamp(layout_.count() / kMinChunkBlocks, 1, kMaxChunks);
}

template <class Real>
template <class Body>
void ExamplePass<Real>::by_chunks(const Body& body) const {
  const int chunks = chunk_count();
  poisson_.pool().run(chunks, [&](int chunk) {
    const auto at = [&](int64_t k) { return static_cast<int>(layout_.count() * k / chunks); };
    body(at(chunk), at(chunk + 1), chunk);
  });
}

template <class Real>
ExampleView<Real> ExamplePass<Real>::view() {
  return {example_count_, blocks_.data(), changes_.data(),
          pose_.data(),   misfit_.data(), derivatives_.data()};
}

template <class Real>
void ExamplePass<Real>::pose(int section, const Eigen::VectorXd& weights, bool rotation_only,
                             double* rows) {
  std::vector<Real> real_weights(size_t(weights.size()));
  for (size_t i = 0; i < real_weights.size(); ++i)
    real_weights[i] = static_cast<Real>(weights[Index(i)]);
  kernels().of<Real>().example_pose(view(), layout_.begin[section], layout_.begin[section + 1],
                                    real_weights.data(), rotation_only, rows);
}

template <class Real>
double ExamplePass<Real>::squared_size() const {
  std::vector<double> sums(size_t(chunk_count()), 0);
  by_chunks([&](int begin, int end, int chunk) {
    double sum = 0;
    for (int b = begin; b < end; ++b)
      for (const auto& lanes : pose_[b].change)
        for (const Real x : lanes) sum += static_cast<double>(x * x);
    sums[chunk] = sum;
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

template <class Real>
double ExamplePass<Real>::misfit(const Rows& offsets) {
  std::vector<double> sums(size_t(chunk_count()), 0);
  by_chunks([&](int begin, int end, int chunk) {
    sums[chunk] = kernels().of<Real>().example_misfit(view(), begin, end, offsets.data());
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

template <class Real>
Rows ExamplePass<Real>::misfit_divergence(int row_count) {
  Rows rows = Rows::Zero(row_count, 4);
  kernels().of<Real>().example_misfit_divergence(view(), 0, layout_.count(), rows.data());
  return rows;
}

template <class Real>
void ExamplePass<Real>::derivative(int example, int section, double* rows) {
  kernels().of<Real>().example_derivative(view(), example, layout_.begin[section],
                                          layout_.begin[section + 1], rows);
}

template <class Real>
void ExamplePass<Real>::second_order(const std::vector<Rows>& position_responses,
                                     Eigen::MatrixXd& hessian, Eigen::VectorXd& gradient) {
  using Lanes = Eigen::Array<Real, kLanes, 1>;
  const size_t count = size_t(example_count_), per_chunk = count * (count + 3) / 2;
  std::vector<Real> sums(size_t(chunk_count()) * per_chunk * kLanes, 0);
  std::vector<ExampleSecondOrder<Real>> bends(size_t(chunk_count()) * count);
  std::vector<const double*> response_rows;
  response_rows.reserve(position_responses.size());
  for (const Rows& rows : position_responses) response_rows.push_back(rows.data());
  const auto chunk_sums = [&](int chunk) {
    return reinterpret_cast<Real(*)[kLanes]>(sums.data() + size_t(chunk) * per_chunk * kLanes);
  };
  by_chunks([&](int begin, int end, int chunk) {
    kernels().of<Real>().example_second_order(view(), begin, end, response_rows.data(),
                                              bends.data() + size_t(chunk) * count,
                                              chunk_sums(chunk));
  });
  hessian.setZero(example_count_, example_count_);
  gradient.setZero(example_count_);
  for (int chunk = 0; chunk < chunk_count(); ++chunk) {
    const Real(*sum)[kLanes] = chunk_sums(chunk);
    const auto next = [&] { return Eigen::Map<const Lanes>(*sum++).template cast<double>().sum(); };
    for (int i = 0; i < example_count_; ++i) {
      for (int k = 0; k <= i; ++k) hessian(i, k) += next();
      gradient[i] += next();
    }
  }
  hessian.template triangularView<Eigen::StrictlyUpper>() = hessian.transpose();
}

template <class Real>
double ExamplePass<Real>::bytes() const {
  return static_cast<double>(
      blocks_.size() * sizeof(ExampleBlock<Real>) + changes_.size() * sizeof(ExampleChange<Real>) +
      pose_.size() * sizeof(ExamplePose<Real>) +
      (misfit_.size() + derivatives_.size()) * sizeof(ExampleGradient<Real>));
}

template class ExamplePass<float>;
template class ExamplePass<double>;

}  // namespace dd
