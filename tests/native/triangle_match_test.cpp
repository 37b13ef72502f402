// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/triangle_match.h"

#include <cmath>

#include "catch.h"
#include "meshes.h"

using namespace dd;

TEST_CASE(
    "stretching a triangle to several times its length lowers its confidence, growing doesn't") {
  const Mesh source = test::grid(9, 9, [](double, double) { return 0.0; });
  const auto confidence_in = [&](const Positions& registered, Index triangle) {
    Match match;
    match.confidence.assign(size_t(source.triangle_count()), 0.8f);
    match.correspondence = identity_correspondence(source, source);
    doubt_stretched(match, source, registered);
    return match.confidence[size_t(triangle)];
  };
  const Positions moved = test::transformed(
      test::rotation_about(1, {1, 2, 3}, {0, 0, 0}, {5, 0, 0}), 40 * source.positions);
  CHECK(confidence_in(moved, 5) == Approx(0.8));
  // Of the same area, but three times as long and a third as wide.
  Positions pulled = source.positions;
  pulled.col(0) *= 3;
  pulled.col(1) /= 3;
  CHECK(confidence_in(pulled, 5) == Approx(0.4));
  CHECK(confidence_in(
            test::transformed(test::rotation_about(1, {1, 2, 3}, {0, 0, 0}, {5, 0, 0}), 7 * pulled),
            9) == Approx(0.4));
  // One corner moves alone.
  Positions spiked = source.positions;
  spiked(0, 2) += 2;
  CHECK(confidence_in(spiked, 0) < 0.1);
  CHECK(confidence_in(spiked, source.triangle_count() - 1) > 0.75);
}

TEST_CASE("opening a triangle lowers its confidence, however thin it was") {
  const double height = GENERATE(1e-3, 1e-6, 1e-8, 2e-9);
  Mesh source{Positions(6, 3), Triangles(2, 3)};
  source.positions << 0, 0, 0, 1, 0, 0, 0, 1, 0, 2, 0, 0, 3, 0, 0, 2.3, height, 0;
  source.triangles << 0, 1, 2, 3, 4, 5;
  Positions opened = source.positions;
  opened(5, 1) = 1;
  Match match{triangle_correspondence({{0, 0}, {1, 1}}, 2, 2), {1, 1}};
  doubt_stretched(match, source, opened);
  INFO(height);
  CHECK(match.confidence[0] == 1);
  // Opened to 1 / height times its width.
  CHECK(match.confidence[1] == Approx(1 / (1 + std::pow((1 / height - 1) / 2, 2))).epsilon(0.5));
}

TEST_CASE("the mean confidence is weighted by the target's area") {
  Mesh target{Positions(5, 3), Triangles(2, 3)};
  target.positions << 0, 0, 0, 3, 0, 0, 0, 1, 0, -1, 0, 0, 0, 0, 0;
  target.triangles << 0, 1, 2, 2, 3, 0;
  Match match{triangle_correspondence({{0, 0}, {1, 1}}, 2, 2), {0.5f, 1}};
  CHECK(mean_confidence(match, target) == Approx((3 * 0.5 + 1) / 4));
  target.triangles << 0, 4, 1, 0, 4, 2;
  CHECK(mean_confidence(match, target) == 0);
}
