// SPDX-License-Identifier: GPL-3.0-or-later
#include "kernels/kernels.h"

#include <cmath>
#include <random>
#include <vector>

#include "catch.h"
#include "dense_reference.h"

using namespace dd;

namespace {

/// The deformation gradient (15) of a lane's triangle, whose corners are the first three rows at
/// rest, from its rest shape in the plane z = 0 to the rows of positions that sources name.
template <class Real>
Eigen::Matrix3d deformation_gradient_of(const TriangleShape<Real>& shape,
                                        const int32_t (&source)[3][kLanes], int lane,
                                        const std::vector<double>& positions) {
  const double length = 1.0 / shape.inverse_length[lane];
  const double height = length / shape.inverse_height[lane];
  Positions rest(3, 3), now(3, 3);
  rest << 0, 0, 0, length, 0, 0, shape.shear[lane] * height, height, 0;
  for (int k = 0; k < 3; ++k)
    for (int c = 0; c < 3; ++c) now(k, c) = positions[size_t(4 * source[k][lane] + c)];
  Triangles one(1, 3);
  one << 0, 1, 2;
  return test::deformation_gradient(rest, now, one, 0);
}

/// A row x y z w, of any length.
template <class Real>
Eigen::Quaterniond quaternion(const Real* row) {
  return {double(row[3]), double(row[0]), double(row[1]), double(row[2])};
}

}  // namespace

TEST_CASE("the kernels for this machine are the widest it has") {
#ifdef DD_HAVE_AVX2_KERNELS
  CHECK(&kernels() == (machine_has_avx2() ? &kAvx2Kernels : &kBaselineKernels));
  CHECK(std::string(kAvx2Kernels.name) == "avx2");
#else
  CHECK(&kernels() == &kBaselineKernels);
#endif
  CHECK(std::string(kBaselineKernels.name) == "baseline");
}

#ifdef DD_HAVE_AVX2_KERNELS
TEMPLATE_TEST_CASE("all instruction sets compute the same", "", float, double) {
  using Real = TestType;
  if (!machine_has_avx2()) {
    WARN("This machine has no AVX2: only the baseline was tested.");
    return;
  }
  const KernelsOf<Real>&plain = kBaselineKernels.of<Real>(), &wide = kAvx2Kernels.of<Real>();
  const double tolerance = sizeof(Real) == 4 ? 2e-5 : 1e-12;
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto numbers = [&](size_t count, auto as) {
    std::vector<decltype(as)> values(count);
    for (auto& v : values) v = static_cast<decltype(as)>(uniform(random));
    return values;
  };
  const auto close = [&](const auto& a, const auto& b) {
    for (size_t i = 0; i < a.size(); ++i)
      if (!(std::abs(a[i] - b[i]) < tolerance)) return false;
    return true;
  };
  const auto shape = [&](TriangleShape<Real>& s, int lane) {
    s.inverse_length[lane] = static_cast<Real>(1 + uniform(random) / 2);
    s.shear[lane] = static_cast<Real>(uniform(random));
    s.inverse_height[lane] = static_cast<Real>(1 + uniform(random) / 2);
  };

  SECTION("factor") {
    // Supernodes of 1 to 11 columns and 0 to 42 rows below, which are the rows that follow.
    std::vector<int32_t> begin{0}, slots;
    std::vector<int64_t> rows{0}, starts{0};
    for (int width = 1; width <= 11; ++width)
      for (int height = 0; height < 43; height += 3) {
        begin.push_back(begin.back() + width);
        for (int i = 0; i < height; ++i) slots.push_back(begin.back() + i);
        rows.push_back(static_cast<int64_t>(slots.size()));
        starts.push_back(starts.back() + packed_triangle_size<Real>(width) + width * height);
      }
    const int count = static_cast<int>(begin.size()) - 1;
    const size_t size = 4 * static_cast<size_t>(begin.back() + 50);
    auto values = numbers(static_cast<size_t>(starts.back()), Real());
    for (Real& value : values) value /= 20;
    const FactorView<Real> factor = {begin.data(), rows.data(), slots.data(), starts.data(),
                                     values.data()};
    const auto right = numbers(size, double());
    const auto start = numbers(size, Real());
    auto a = start, b = start, c = start, d = start;
    plain.forward(factor, 0, count, right.data(), a.data());
    wide.forward(factor, 0, count, right.data(), b.data());
    plain.forward_four(factor, 0, count, right.data(), c.data());
    wide.forward_four(factor, 0, count, right.data(), d.data());
    const auto first_columns = [](std::vector<Real> x) {
      for (size_t i = 3; i < x.size(); i += 4) x[i] = 0;
      return x;
    };
    CHECK(close(first_columns(a), first_columns(b)));
    CHECK(close(first_columns(a), first_columns(c)));
    CHECK(close(c, d));
    plain.backward(factor, 0, count, a.data());
    wide.backward(factor, 0, count, b.data());
    plain.backward_four(factor, 0, count, c.data());
    wide.backward_four(factor, 0, count, d.data());
    CHECK(close(first_columns(a), first_columns(b)));
    CHECK(close(first_columns(a), first_columns(c)));
    CHECK(close(c, d));
  }
  SECTION("blend") {
    // Kernels take several rows at a time and the rest one by one.
    for (int count : {7, 19}) {
      const auto weights = numbers(count * 8, double()), coefficients = numbers(4 * 8, double()),
                 rest = numbers(4 * count, double());
      std::vector<double> a(4 * size_t(count)), b(a), c(a);
      kBaselineKernels.blend(count, 8, weights.data(), coefficients.data(), rest.data(), a.data());
      kAvx2Kernels.blend(count, 8, weights.data(), coefficients.data(), rest.data(), b.data());
      CHECK(close(a, b));
      using RowMajor = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
      const auto matrix = [](const std::vector<double>& of, int rows) {
        return RowMajor(Eigen::Map<const RowMajor>(of.data(), rows, Index(of.size()) / rows));
      };
      const RowMajor expected =
          matrix(rest, count) + matrix(weights, count) * matrix(coefficients, 8);
      CHECK((matrix(a, count) - expected).cwiseAbs().maxCoeff() < 1e-14);
      // The bits of a row don't depend on where its range begins.
      for (int r = 0; r < count; ++r)
        kAvx2Kernels.blend(1, 8, weights.data() + 8 * r, coefficients.data(), rest.data() + 4 * r,
                           c.data() + 4 * r);
      CHECK(b == c);
    }
  }
  SECTION("gradient pass") {
    std::vector<TriangleBlock<Real>> blocks(3);
    for (auto& block : blocks) {
      for (int lane = 0; lane < kLanes; ++lane) {
        for (int k = 0; k < 3; ++k) {
          block.source[k][lane] = 6 * k + static_cast<int>(random() % 6);
          block.target[k][lane] = static_cast<int>(random() % 20);
        }
        shape(block.shape, lane);
        for (auto& corner : block.flux)
          for (auto& coordinate : corner) coordinate[lane] = static_cast<Real>(uniform(random));
      }
    }
    const auto base = numbers(4 * 20, double());
    for (bool rotation_only : {false, true}) {
      const auto start = numbers(4 * 20, double());
      auto a = start, b = start, expected = start;
      plain.gradient_pass(3, blocks.data(), base.data(), rotation_only, a.data());
      wide.gradient_pass(3, blocks.data(), base.data(), rotation_only, b.data());
      CHECK(close(a, b));
      // The same by (15) and singular values. A triangle's fluxes sum to zero.
      for (const auto& block : blocks)
        for (int lane = 0; lane < kLanes; ++lane) {
          Eigen::Matrix3d S = deformation_gradient_of(block.shape, block.source, lane, base);
          if (rotation_only) S = test::polar_rotation(S);
          for (int k = 0; k < 3; ++k)
            for (int corner = 0; corner < 2; ++corner) {
              if (k != corner && k != 2) continue;
              const auto& flux = block.flux[corner];
              const Eigen::Vector3d turned =
                  S * Eigen::Vector3d(flux[0][lane], flux[1][lane], flux[2][lane]);
              for (int c = 0; c < 3; ++c)
                expected[size_t(4 * block.target[k][lane] + c)] += k == 2 ? -turned[c] : turned[c];
            }
        }
      CHECK(close(a, expected));
    }
  }
  SECTION("poses by example") {
    constexpr int kBlocks = 3, kExamples = 4;
    std::vector<ExampleBlock<Real>> blocks(kBlocks);
    std::vector<ExampleChange<Real>> changes(kBlocks * kExamples);
    for (auto& block : blocks) {
      for (int lane = 0; lane < kLanes; ++lane)
        for (int k = 0; k < 3; ++k) {
          block.corner[k][lane] = static_cast<int>(random() % 20);
          block.target[k][lane] = static_cast<int>(random() % 20);
        }
      for (auto* lanes : {&block.a, &block.b, &block.c})
        for (Real& value : *lanes) value = static_cast<Real>(uniform(random));
      for (auto& lanes : block.rest)
        for (Real& value : lanes) value = static_cast<Real>(uniform(random));
    }
    for (auto& change : changes) {
      for (auto& lanes : change.turn)
        for (Real& value : lanes) value = static_cast<Real>(uniform(random));
      for (auto& lanes : change.stretch)
        for (Real& value : lanes) value = static_cast<Real>(uniform(random));
    }
    const auto offsets = numbers(4 * 20, double());
    std::vector<std::vector<double>> followed;
    for (int i = 0; i < kExamples; ++i) followed.push_back(numbers(4 * 20, double()));
    const auto start = numbers(4 * 20, double());
    for (bool rotation_only : {false, true})
      // Turns of about a degree, by series, and of about a radian, by quotients.
      for (const Real size : {Real(0.02), Real(1)}) {
        const std::vector<Real> weights = {size, 0, -size / 2, 2 * size};
        struct Result {
          std::vector<double> rows;
          double misfit;
          std::vector<Real> sums;
        };
        const auto run = [&](const KernelsOf<Real>& set) {
          std::vector<ExamplePose<Real>> poses(kBlocks);
          std::vector<ExampleGradient<Real>> misfits(kBlocks), derivatives(kBlocks * kExamples);
          const ExampleView<Real> view = {kExamples,    blocks.data(),  changes.data(),
                                          poses.data(), misfits.data(), derivatives.data()};
          Result result;
          result.rows = start;
          double* rows = result.rows.data();
          set.example_pose(view, 0, kBlocks, weights.data(), rotation_only, rows);
          result.misfit = set.example_misfit(view, 0, kBlocks, offsets.data());
          set.example_misfit_divergence(view, 0, kBlocks, rows);
          for (int i = 0; i < kExamples; ++i) set.example_derivative(view, i, 0, kBlocks, rows);
          std::vector<ExampleSecondOrder<Real>> second_order(kExamples);
          result.sums.assign(kExamples * (kExamples + 3) / 2 * kLanes, 0);
          const double* of[kExamples];
          for (int i = 0; i < kExamples; ++i) of[i] = followed[size_t(i)].data();
          set.example_second_order(view, 0, kBlocks, of, second_order.data(),
                                   reinterpret_cast<Real(*)[kLanes]>(result.sums.data()));
          return result;
        };
        const Result a = run(plain), b = run(wide);
        // Relative to at least 10, as these are sums of hundreds of products.
        const auto alike = [&](const auto& x, const auto& y) {
          for (size_t i = 0; i < x.size(); ++i)
            if (!(std::abs(x[i] - y[i]) < tolerance * (10 + std::abs(x[i])))) return false;
          return true;
        };
        CHECK(alike(a.rows, b.rows));
        CHECK(a.misfit == Approx(b.misfit).epsilon(tolerance));
        CHECK(a.misfit > 1);
        CHECK(alike(a.sums, b.sums));
      }
  }
  SECTION("rotations and what they turn") {
    std::vector<RotationBlock<Real>> blocks(3);
    std::vector<RotatedFluxBlock<Real>> turns(3);
    for (int b = 0; b < 3; ++b)
      for (int lane = 0; lane < kLanes; ++lane) {
        for (int k = 0; k < 3; ++k) {
          blocks[b].source[k][lane] = 6 * k + static_cast<int>(random() % 6);
          turns[b].corner[k][lane] = static_cast<int>(random() % (3 * kLanes));
          turns[b].target[k][lane] = static_cast<int>(random() % 20);
        }
        shape(blocks[b].shape, lane);
        for (int c = 0; c < 4; ++c)
          blocks[b].from_rest[c][lane] = static_cast<Real>(uniform(random));
        for (auto& corner : turns[b].flux)
          for (auto& coordinate : corner) coordinate[lane] = static_cast<Real>(uniform(random));
      }
    const auto positions = numbers(4 * 20, double());
    std::vector<Real> a(3 * kLanes * 4), b = a;
    plain.rotation_pass(3, blocks.data(), positions.data(), a.data());
    wide.rotation_pass(3, blocks.data(), positions.data(), b.data());
    CHECK(close(a, b));
    // The rotation by singular values, in the frame at rest; the quaternion of that frame has any
    // length here, which is kept.
    double worst = 0, least_w = 1;
    for (int row = 0; row < 3 * kLanes; ++row) {
      const RotationBlock<Real>& block = blocks[size_t(row / kLanes)];
      const int lane = row % kLanes;
      const Real of_rest[] = {block.from_rest[0][lane], block.from_rest[1][lane],
                              block.from_rest[2][lane], block.from_rest[3][lane]};
      const Eigen::Quaterniond from_rest = quaternion(of_rest);
      const Eigen::Quaterniond found = quaternion(&a[size_t(4 * row)]);
      const Eigen::Matrix3d expected = test::polar_rotation(deformation_gradient_of(
                                           block.shape, block.source, lane, positions)) *
                                       from_rest.normalized().toRotationMatrix();
      worst = std::max({worst, std::abs(found.norm() - from_rest.norm()),
                        (found.normalized().toRotationMatrix() - expected).norm()});
      least_w = std::min(least_w, found.w());
    }
    CHECK(worst < 50 * tolerance);
    CHECK(least_w >= 0);
    auto right = numbers(4 * 20, double()), right_wide = right;
    plain.rotated_flux_pass(3, turns.data(), a.data(), right.data());
    wide.rotated_flux_pass(3, turns.data(), a.data(), right_wide.data());
    CHECK(close(right, right_wide));
    // Unit quaternions that have a mean, as neighbours have.
    std::vector<Real> near;
    for (int row = 0; row < 3 * kLanes; ++row) {
      Eigen::Vector4d q = Eigen::Vector4d(0.1, -0.2, 0.3, 0.9);
      for (double& c : q) c += 0.2 * uniform(random);
      q.normalize();
      for (double c : q) near.push_back(static_cast<Real>(c));
    }
    std::vector<ArmBlock<Real>> arm_blocks(2);
    for (ArmBlock<Real>& block : arm_blocks) {
      for (auto& row : block.corner)
        for (int32_t& corner : row) corner = static_cast<int32_t>(random() % (3 * kLanes));
      const std::vector<Real> filling = numbers((6 + 6 + 3) * kLanes, Real());
      std::copy_n(filling.data(), 6 * kLanes, &block.arm_edge[0][0][0]);
      std::copy_n(filling.data() + 6 * kLanes, 6 * kLanes, &block.centre_edge[0][0][0]);
      std::copy_n(filling.data() + 12 * kLanes, 3 * kLanes, &block.normal[0][0]);
    }
    std::vector<Real> areas(2 * kLanes), areas_wide(areas);
    const std::vector<double> changes = numbers(4 * 3 * kLanes, double());
    plain.arm_areas(2, arm_blocks.data(), near.data(), changes.data(), areas.data());
    wide.arm_areas(2, arm_blocks.data(), near.data(), changes.data(), areas_wide.data());
    CHECK(close(areas, areas_wide));
    for (int i = 0; i < 2 * kLanes; ++i) {
      const ArmBlock<Real>& block = arm_blocks[size_t(i / kLanes)];
      const int lane = i % kLanes;
      const auto vector = [&](const Real(&of)[3][kLanes]) {
        return Eigen::Vector3d(of[0][lane], of[1][lane], of[2][lane]);
      };
      Eigen::Quaterniond mean(0, 0, 0, 0);
      for (const auto& corner : block.corner)
        mean.coeffs() += quaternion(&near[size_t(4 * corner[lane])]).coeffs();
      mean.normalize();
      const auto edge = [&](int k) -> Eigen::Vector3d {
        const auto change = [&](int of) {
          return Eigen::Map<const Eigen::Vector3d>(&changes[size_t(4 * block.corner[of][lane])]);
        };
        return mean * vector(block.centre_edge[k]) + vector(block.arm_edge[k]) + change(k + 1) -
               change(0);
      };
      const double expected = edge(0).cross(edge(1)).dot(mean * vector(block.normal));
      CHECK(std::abs(areas[size_t(i)] - expected) < 10 * tolerance);
    }
    auto turning = near;
    for (int row : {1, 5}) std::fill_n(&turning[size_t(4 * row)], 4, Real(0));
    for (Real& c : turning) c *= Real(0.7);
    auto vectors = numbers(4 * 3 * kLanes, double());
    for (size_t i = 3; i < vectors.size(); i += 4) vectors[i] = 0;
    std::vector<double> turned(vectors.size(), 1), turned_wide(turned);
    plain.turn_vectors(3 * kLanes, turning.data(), vectors.data(), turned.data());
    wide.turn_vectors(3 * kLanes, turning.data(), vectors.data(), turned_wide.data());
    for (int row = 0; row < 3 * kLanes; ++row) {
      const Eigen::Quaterniond q = quaternion(&turning[size_t(4 * row)]);
      const Eigen::Map<const Eigen::Vector4d> r(&vectors[size_t(4 * row)]),
          of_plain(&turned[size_t(4 * row)]), of_wide(&turned_wide[size_t(4 * row)]);
      Eigen::Vector4d expected = Eigen::Vector4d::Zero();
      if (q.norm() > 0) expected.head<3>() = q.normalized() * r.head<3>() - r.head<3>();
      CHECK((of_plain - expected).norm() < 1e-14);
      CHECK((of_wide - expected).norm() < 1e-14);
    }
    const std::vector<int> starts = {0, 3, 5, 9};
    int32_t index[9][kLanes];
    Real weights[9][kLanes];
    for (auto& row : index)
      for (int32_t& i : row) i = static_cast<int32_t>(random() % (3 * kLanes));
    for (auto& row : weights)
      for (Real& weight : row) weight = Real(0.3);
    std::vector<Real> mean(3 * kLanes * 4), mean_wide(mean);
    plain.mean_rotations(0, 3, starts.data(), index, weights, a.data(), mean.data());
    wide.mean_rotations(0, 3, starts.data(), index, weights, a.data(), mean_wide.data());
    CHECK(close(mean, mean_wide));
  }
}
#endif

TEST_CASE("the mean of rotations does not depend on the signs of their quaternions") {
  // Nor does flux that is turned by a mean: by the rotation matrix of the sum of three.
  RotatedFluxBlock<double> turned = {};
  for (int lane = 0; lane < kLanes; ++lane)
    for (int k = 0; k < 3; ++k) {
      turned.corner[k][lane] = (lane + 2 * k) % 6;
      turned.target[k][lane] = 3 * lane + k;
      for (int corner = 0; corner < 2; ++corner)
        turned.flux[corner][k][lane] = std::sin(1.0 + lane + 3 * k + 7 * corner);
    }
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.1, 0.1);
  const std::vector<int> starts = {0, 6};
  const double of_each[] = {0.1, 0.2, 0.15, 0.25, 0.2, 0.1};
  int32_t index[6][kLanes];
  double weights[6][kLanes];
  for (int k = 0; k < 6; ++k)
    for (int lane = 0; lane < kLanes; ++lane) {
      index[k][lane] = k;
      weights[k][lane] = of_each[k];
    }
  for (int round = 0; round < 100; ++round) {
    std::vector<double> rotations(24), mean(4 * kLanes), flipped_mean(4 * kLanes);
    for (int q = 0; q < 6; ++q) {
      double length = 0;
      for (int c = 0; c < 4; ++c) {
        rotations[4 * q + c] = (c == round % 4 ? 1 : 0) + uniform(random);
        length += rotations[4 * q + c] * rotations[4 * q + c];
      }
      for (int c = 0; c < 4; ++c) rotations[4 * q + c] /= std::sqrt(length);
    }
    kernels().full.mean_rotations(0, 1, starts.data(), index, weights, rotations.data(),
                                  mean.data());
    Eigen::Vector4d sum = Eigen::Vector4d::Zero();
    for (int q = 0; q < 6; ++q)
      sum += of_each[q] * Eigen::Map<const Eigen::Vector4d>(&rotations[4 * size_t(q)]);
    CHECK((Eigen::Map<const Eigen::Vector4d>(mean.data()) - sum.normalized()).norm() < 1e-14);
    std::vector<double> expected_flux;
    for (int lane = 0; lane < kLanes; ++lane) {
      sum.setZero();
      for (int k = 0; k < 3; ++k)
        sum += Eigen::Map<const Eigen::Vector4d>(&rotations[4 * size_t(turned.corner[k][lane])]);
      const Eigen::Matrix3d R = quaternion(sum.data()).normalized().toRotationMatrix();
      Eigen::Matrix<double, 4, 3> of_corners = Eigen::Matrix<double, 4, 3>::Zero();
      for (int corner = 0; corner < 2; ++corner)
        for (int c = 0; c < 3; ++c) of_corners(c, corner) = turned.flux[corner][c][lane];
      of_corners.topRows<3>() = R * of_corners.topRows<3>();
      of_corners.col(2) = -of_corners.col(0) - of_corners.col(1);
      expected_flux.insert(expected_flux.end(), of_corners.data(), of_corners.data() + 12);
    }
    // Every second quaternion has the other sign, as beyond half a turn.
    for (int q = round % 2; q < 6; q += 2)
      for (int c = 0; c < 4; ++c) rotations[4 * q + c] *= -1;
    kernels().full.mean_rotations(0, 1, starts.data(), index, weights, rotations.data(),
                                  flipped_mean.data());
    double cosine = 0;
    for (int c = 0; c < 4; ++c) cosine += mean[c] * flipped_mean[c];
    CHECK(std::abs(std::abs(cosine) - 1) < 1e-12);
    std::vector<double> flux(expected_flux.size());
    kernels().full.rotated_flux_pass(1, &turned, rotations.data(), flux.data());
    double worst = 0;
    for (size_t i = 0; i < flux.size(); ++i)
      worst = std::max(worst, std::abs(flux[i] - expected_flux[i]));
    CHECK(worst < 1e-14);
  }
}
