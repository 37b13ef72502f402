// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/riding_parts.h"

#include <Eigen/Dense>
#include <numeric>
#include <random>

#include "catch.h"
#include "dense_reference.h"
#include "support/error.h"
#include "support/rotations.h"

using namespace dd;

namespace {

using FloatRows = RidingParts::FloatRows;

/// A bumpy plane with a plate of five vertices above each of some places: group g rides on the
/// triangles around them.
struct Plates {
  explicit Plates(int triangles_each, double size = 0.3) {
    mesh = test::grid(21, 21, [](double x, double y) { return 0.1 * std::sin(7 * x + 4 * y); });
    skin = mesh.vertex_count();
    const int places = mesh.triangle_count() / triangles_each;
    Positions all(skin + 5 * places, 3);
    all.topRows(skin) = mesh.positions;
    std::mt19937 random(3);
    std::uniform_real_distribution<double> any(-0.1, 0.1);
    for (int g = 0; g < places; ++g) {
      sizes.push_back(size);
      for (int k = 0; k < triangles_each; ++k) contacts.push_back({g, g * triangles_each + k});
      for (int k = 0; k < 5; ++k) {
        const int v = skin + 5 * g + k;
        all.row(v) = mesh.positions.row(mesh.triangles(g * triangles_each, 0)) +
                     Eigen::RowVector3d(any(random), any(random), 0.1);
        riders.push_back({v, g});
      }
    }
    mesh.positions = all.cast<float>().cast<double>();
  }

  /// Where all vertices go if the skin goes to these places.
  Positions placed(const Positions& moved, int threads = 1) const {
    RidingParts parts(mesh, riders, contacts, sizes, threads);
    FloatRows offsets = (moved - mesh.positions).cast<float>();
    offsets.bottomRows(offsets.rows() - skin).setConstant(7);  // to be written
    parts.place(offsets, offsets);
    return mesh.positions + offsets.cast<double>();
  }

  Mesh mesh;
  int skin;
  Pairs riders, contacts;
  std::vector<double> sizes;
};

Positions curved(const Positions& p) {
  Positions moved = p;
  for (Index v = 0; v < p.rows(); ++v)
    moved.row(v) << (1.2 + p(v, 2)) * std::sin(p(v, 0)), p(v, 1) * (1 + 0.3 * p(v, 0)),
        (1.2 + p(v, 2)) * std::cos(p(v, 0));
  return moved;
}

/// The requested motion of a group by (15), a dense polar decomposition and plain sums.
Positions expected(const Plates& plates, const Positions& moved, int group) {
  const Triangles& t = plates.mesh.triangles;
  const Positions& p = plates.mesh.positions;
  Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();
  Eigen::RowVector3d before = Eigen::RowVector3d::Zero(), after = before;
  double sum = 0;
  for (const auto& [g, j] : plates.contacts) {
    if (g != group) continue;
    const Eigen::RowVector3d a = p.row(t(j, 0)), b = p.row(t(j, 1)), c = p.row(t(j, 2));
    const double area = (b - a).cross(c - a).norm() / 2;
    gradient += area * test::deformation_gradient(p, moved, t, j);
    for (int k = 0; k < 3; ++k) {
      before += area / 3 * p.row(t(j, k));
      after += area / 3 * moved.row(t(j, k));
    }
    sum += area;
  }
  const Eigen::Matrix3d R = test::polar_rotation(gradient / sum);
  const Positions arms = p.middleRows(plates.skin + 5 * group, 5).rowwise() - before / sum;
  return (arms * R.transpose()).rowwise() + after / sum;
}

}  // namespace

TEST_CASE("what rides on a rigid motion moves by it") {
  for (const int each : {1, 3, 8}) {
    const Plates plates(each);
    const Positions moved = test::transformed(
        test::rotation_about(2.5, {1, 2, -1}, {0.3, 0, 1}, {4, -2, 1}), plates.mesh.positions);
    CHECK(test::largest_difference(plates.placed(moved), moved) < 1e-6 * 10);
  }
}

TEST_CASE("riders move by the mean of the triangles' gradients and places") {
  for (const int each : {1, 2, 3}) {  // too few for a median
    const Plates plates(each);
    const Positions moved = curved(plates.mesh.positions), found = plates.placed(moved);
    for (int g = 0; g < static_cast<int>(plates.sizes.size()); g += 5)
      CHECK((found.middleRows(plates.skin + 5 * g, 5) - expected(plates, moved, g))
                .cwiseAbs()
                .maxCoeff() < 1e-6);
  }
  const Plates plates(40, 0);  // without a size by means, too
  const Positions moved = curved(plates.mesh.positions), found = plates.placed(moved);
  for (int g = 0; g < static_cast<int>(plates.sizes.size()); ++g)
    CHECK((found.middleRows(plates.skin + 5 * g, 5) - expected(plates, moved, g))
              .cwiseAbs()
              .maxCoeff() < 1e-6);
}

TEST_CASE("where what is beneath moves apart, riders go with most of it") {
  // 40 triangles, each by itself, of which the last 12 are lifted by 1.
  constexpr int kCount = 40, kLifted = 12;
  Mesh mesh;
  mesh.positions.resize(3 * kCount + 1, 3);
  mesh.triangles.resize(kCount, 3);
  Pairs contacts;
  for (int j = 0; j < kCount; ++j) {
    const double x = j % 8, y = j / 8;
    mesh.positions.middleRows(3 * j, 3) << x, y, 0, x + 0.5, y, 0, x, y + 0.5, 0;
    mesh.triangles.row(j) << 3 * j, 3 * j + 1, 3 * j + 2;
    contacts.push_back({0, j});
  }
  mesh.positions.bottomRows(1) << 1, 2, 3;
  const auto lift = [&](double size) {
    RidingParts parts(mesh, {{3 * kCount, 0}}, contacts, {size}, 1);
    FloatRows offsets = FloatRows::Zero(3 * kCount + 1, 3);
    offsets.middleRows(3 * (kCount - kLifted), 3 * kLifted).col(2).setConstant(1);
    parts.place(offsets, offsets);
    return double{offsets(3 * kCount, 2)};
  };
  CHECK(lift(0) == Approx(double(kLifted) / kCount));  // the mean
  // The smoothed median, where the pulls of both kinds are in balance, is found by bisection.
  double low = 0, high = 1;
  const auto pull = [](double distance) {
    const double far = distance / (0.02 * 8);
    return distance / std::sqrt(1 + std::max(far * far - 0.01, 0.0));
  };
  for (int step = 0; step < 60; ++step) {
    const double middle = (low + high) / 2;
    ((kCount - kLifted) * pull(middle) < kLifted * pull(1 - middle) ? low : high) = middle;
  }
  CHECK(lift(8) == Approx(low).epsilon(0.03));
  CHECK(lift(8) < 0.3 * lift(0));
  CHECK(lift(100) == Approx(lift(0)).epsilon(0.1));  // to a part as large they hardly move apart
}

TEST_CASE("riders move continuously, and don't depend on unit or threads") {
  const Plates plates(20);
  Positions before;
  for (int step = 0; step <= 200; ++step) {
    Positions moved = plates.mesh.positions;
    for (Index v = 0; v < plates.skin; ++v)
      if (moved(v, 0) > 0.5) moved(v, 2) += step / 400.0;
    const Positions found = plates.placed(moved);
    if (step > 0) CHECK(test::largest_difference(found, before) < 0.01);
    before = found;
  }
  const Positions moved = curved(plates.mesh.positions), found = plates.placed(moved);
  CHECK(plates.placed(moved, 3) == found);
  Plates larger = plates;
  larger.mesh.positions *= 1024;
  for (double& size : larger.sizes) size *= 1024;
  CHECK(test::largest_difference(larger.placed(1024 * moved) / 1024, found) < 1e-6);
}

TEST_CASE("the number of threads changes nothing that rides", "[threads]") {
  const Plates plates(1);
  const Positions moved = curved(plates.mesh.positions);
  CHECK(plates.placed(moved, 1) == plates.placed(moved, 3));
}

TEST_CASE("riders on what stays have no offset, and no other vertex is written") {
  const Plates plates(8);
  RidingParts parts(plates.mesh, plates.riders, plates.contacts, plates.sizes, 1);
  FloatRows offsets = FloatRows::Zero(parts.vertex_count(), 3), placed = offsets;
  placed.setConstant(3);
  parts.place(offsets, placed);
  CHECK((placed.topRows(plates.skin).array() == 3).all());
  CHECK((placed.bottomRows(placed.rows() - plates.skin).array() == 0).all());
}

TEST_CASE("riders on triangles without an area move by their places alone") {
  Mesh mesh;
  mesh.positions.resize(4, 3);
  mesh.positions << 0, 0, 0, 1, 0, 0, 2, 0, 0, 1, 1, 0;
  mesh.triangles.resize(1, 3);
  mesh.triangles << 0, 1, 2;
  RidingParts parts(mesh, {{3, 0}}, {{0, 0}}, {1}, 1);
  FloatRows offsets = FloatRows::Zero(4, 3);
  offsets.topRows(3) << 0, 0, 3, 0, 0, 3, 0, 3, 0;
  parts.place(offsets, offsets);
  CHECK((offsets.row(3) - Eigen::RowVector3f(0, 1, 2)).norm() < 1e-6);
  // One that loses its area in a pose has a motion that is finite.
  mesh.positions.row(2) << 1, 0.5, 1;
  RidingParts flattened(mesh, {{3, 0}}, {{0, 0}}, {1}, 1);
  offsets.topRows(3) = -mesh.positions.topRows(3).cast<float>();
  flattened.place(offsets, offsets);
  CHECK(offsets.allFinite());
}

TEST_CASE("what can't ride is refused") {
  const Plates plates(8);
  const auto refusal = [&](const Pairs& riders, const Pairs& contacts, std::vector<double> sizes) {
    try {
      RidingParts(plates.mesh, riders, contacts, sizes, 1);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const int last = plates.mesh.vertex_count() - 1, triangles = plates.mesh.triangle_count();
  CHECK_THAT(refusal({{last + 1, 0}}, {{0, 0}}, {1}), contains("options.riders has a vertex"));
  CHECK_THAT(refusal({{last, 1}}, {{0, 0}}, {1}), contains("options.riders has a group"));
  CHECK_THAT(refusal({{last, 0}, {last, 0}}, {{0, 0}}, {1}), contains("twice"));
  CHECK_THAT(refusal({{last, 0}}, {{0, triangles}}, {1}),
             contains("options.contacts has a triangle"));
  CHECK_THAT(refusal({{last, 0}}, {{-1, 0}}, {1}), contains("options.contacts has a group"));
  CHECK_THAT(refusal({{last, 0}}, {}, {1}), contains("group 0 has no triangle"));
  CHECK_THAT(refusal({{last, 0}}, {{0, 0}}, {-1}), contains("options.sizes has a number"));
  CHECK_THAT(refusal({{plates.mesh.triangles(0, 1), 0}}, {{0, 0}}, {1}), contains("which rides"));
  // Motions that leave the range of single precision are, too, and nothing is written then.
  RidingParts parts(plates.mesh, plates.riders, plates.contacts, plates.sizes, 1);
  FloatRows offsets = FloatRows::Constant(parts.vertex_count(), 3, 3e38f), placed = offsets;
  placed.setConstant(3);
  CHECK_THROWS_AS(parts.place(offsets, placed), Error);
  CHECK((placed.array() == 3).all());
}

TEST_CASE("Newton's iteration finds the rotation of the polar decomposition") {
  std::mt19937 random(5);
  std::normal_distribution<double> any;
  for (int i = 0; i < 2000; ++i) {
    Eigen::Matrix3d A;
    for (double& value : A.reshaped()) value = any(random);
    if (i % 4 == 0) A.col(2) *= 1e-4;  // next to flat
    if (i % 4 == 1) A *= 1e-20;
    // The rotation is as well determined as the sum of the two smaller singular values.
    const Eigen::Vector3d s = Eigen::JacobiSVD<Eigen::Matrix3d>(A).singularValues();
    const double gap = s[1] + (A.determinant() > 0 ? s[2] : -s[2]);
    CHECK((polar_rotation_by_newton(A) - test::polar_rotation(A)).norm() < 1e-12 * s[0] / gap);
  }
  CHECK(polar_rotation_by_newton(Eigen::Matrix3d::Zero()).isUnitary());
}
