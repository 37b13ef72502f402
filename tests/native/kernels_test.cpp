// SPDX-License-Identifier: GPL-3.0-or-later
#include "kernels.h"

#include <cstring>
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
  if (!machine_has_avx2()) return;
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
}
#endif
