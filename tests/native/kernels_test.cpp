// SPDX-License-Identifier: GPL-3.0-or-later
#include "kernels.h"

#include <cmath>
#include <random>
#include <vector>

#include "catch.h"

using namespace dd;

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
TEST_CASE("all instruction sets compute the same") {
  if (!machine_has_avx2()) {
    WARN("This machine has no AVX2: only the baseline was tested.");
    return;
  }
  std::mt19937 random(11);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const auto numbers = [&](size_t count) {
    std::vector<double> values(count);
    for (double& v : values) v = uniform(random);
    return values;
  };
  const auto close = [](const std::vector<double>& a, const std::vector<double>& b) {
    for (size_t i = 0; i < a.size(); ++i)
      if (!(std::abs(a[i] - b[i]) < 1e-12)) return false;
    return true;
  };

  SECTION("factor") {
    const int size = 9;  // a full unit lower triangle, columns of every length
    std::vector<int> starts{0}, rows_of;
    for (int j = 0; j < size; ++j) {
      for (int i = j + 1; i < size; ++i) rows_of.push_back(i);
      starts.push_back(static_cast<int>(rows_of.size()));
    }
    const auto values = numbers(rows_of.size()), pivots = numbers(size);
    auto a = numbers(4 * size), b = a;
    kBaselineKernels.solve_factor(size, starts.data(), rows_of.data(), values.data(), pivots.data(),
                                  a.data());
    kAvx2Kernels.solve_factor(size, starts.data(), rows_of.data(), values.data(), pivots.data(),
                              b.data());
    CHECK(close(a, b));
  }
  SECTION("blend") {
    const auto weights = numbers(7 * 8), coefficients = numbers(4 * 8), rest = numbers(4 * 7);
    std::vector<double> a(4 * 7), b(4 * 7);
    kBaselineKernels.blend(7, 8, weights.data(), coefficients.data(), rest.data(), a.data());
    kAvx2Kernels.blend(7, 8, weights.data(), coefficients.data(), rest.data(), b.data());
    CHECK(close(a, b));
  }
  SECTION("gradient pass") {
    std::vector<TriangleBlock> blocks(3);
    for (auto& block : blocks) {
      for (int lane = 0; lane < kLanes; ++lane) {
        for (int k = 0; k < 3; ++k) {
          block.source[k][lane] = 6 * k + static_cast<int>(random() % 6);
          block.target[k][lane] = static_cast<int>(random() % 20);
        }
        block.inverse_length[lane] = 1 + uniform(random) / 2;
        block.shear[lane] = uniform(random);
        block.inverse_height[lane] = 1 + uniform(random) / 2;
        for (auto& corner : block.flux)
          for (auto& coordinate : corner) coordinate[lane] = uniform(random);
      }
    }
    const auto base = numbers(4 * 20);
    for (bool rotation_only : {false, true}) {
      auto a = numbers(4 * 20), b = a;
      kBaselineKernels.gradient_pass(3, blocks.data(), base.data(), rotation_only, a.data());
      kAvx2Kernels.gradient_pass(3, blocks.data(), base.data(), rotation_only, b.data());
      CHECK(close(a, b));
    }
  }
  SECTION("rotations and what they turn") {
    std::vector<RotationBlock> blocks(3);
    std::vector<TurnBlock> turns(3);
    for (int b = 0; b < 3; ++b)
      for (int lane = 0; lane < kLanes; ++lane) {
        for (int k = 0; k < 3; ++k) {
          blocks[b].source[k][lane] = 6 * k + static_cast<int>(random() % 6);
          turns[b].target[k][lane] = static_cast<int>(random() % 20);
        }
        blocks[b].inverse_length[lane] = 1 + uniform(random) / 2;
        blocks[b].shear[lane] = uniform(random);
        blocks[b].inverse_height[lane] = 1 + uniform(random) / 2;
        for (int c = 0; c < 4; ++c) blocks[b].from_rest[c][lane] = uniform(random);
        for (auto& corner : turns[b].flux)
          for (auto& coordinate : corner) coordinate[lane] = uniform(random);
      }
    const auto positions = numbers(4 * 20);
    std::vector<double> a(3 * kLanes * 4), b = a;
    kBaselineKernels.rotation_pass(3, blocks.data(), positions.data(), a.data());
    kAvx2Kernels.rotation_pass(3, blocks.data(), positions.data(), b.data());
    CHECK(close(a, b));
    auto right = numbers(4 * 20), right_wide = right;
    kBaselineKernels.turn_pass(3, turns.data(), a.data(), right.data());
    kAvx2Kernels.turn_pass(3, turns.data(), a.data(), right_wide.data());
    CHECK(close(right, right_wide));
    const std::vector<int> starts = {0, 3, 5, 9}, index = {0, 5, 7, 2, 3, 8, 9, 10, 11};
    const std::vector<double> weights(9, 0.3);
    std::vector<double> mean(12), mean_wide(12);
    kBaselineKernels.mean_rotations(3, starts.data(), index.data(), weights.data(), a.data(),
                                    mean.data());
    kAvx2Kernels.mean_rotations(3, starts.data(), index.data(), weights.data(), a.data(),
                                mean_wide.data());
    CHECK(close(mean, mean_wide));
  }
}
#endif

TEST_CASE("the mean of rotations does not depend on the signs of their quaternions") {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.1, 0.1);
  const std::vector<int> starts = {0, 6}, index = {0, 1, 2, 3, 4, 5};
  const std::vector<double> weights = {0.1, 0.2, 0.15, 0.25, 0.2, 0.1};
  for (int round = 0; round < 100; ++round) {
    std::vector<double> rotations(24), mean(4), flipped_mean(4);
    for (int q = 0; q < 6; ++q) {
      double length = 0;
      for (int c = 0; c < 4; ++c) {
        rotations[4 * q + c] = (c == round % 4 ? 1 : 0) + uniform(random);
        length += rotations[4 * q + c] * rotations[4 * q + c];
      }
      for (int c = 0; c < 4; ++c) rotations[4 * q + c] /= std::sqrt(length);
    }
    kernels().mean_rotations(1, starts.data(), index.data(), weights.data(), rotations.data(),
                             mean.data());
    // Every second has the other sign, as on both sides of half a turn.
    for (int q = round % 2; q < 6; q += 2)
      for (int c = 0; c < 4; ++c) rotations[4 * q + c] *= -1;
    kernels().mean_rotations(1, starts.data(), index.data(), weights.data(), rotations.data(),
                             flipped_mean.data());
    double cosine = 0;
    for (int c = 0; c < 4; ++c) cosine += mean[c] * flipped_mean[c];
    CHECK(std::abs(std::abs(cosine) - 1) < 1e-12);
  }
}
