// SPDX-License-Identifier: GPL-3.0-or-later
// Garments and props that follow a body.
#include "catch.h"
#include "deform/mesh_transfer.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "meshes.h"
#include "support/rotations.h"

using namespace dd;
using test::largest_difference;

namespace {

/// A tube about the z axis from z = low to high, whose normals point outwards.
Mesh tube(double radius, double low, double high, int around, int along) {
  Mesh mesh;
  mesh.positions.resize(around * (along + 1), 3);
  for (int i = 0; i <= along; ++i)
    for (int k = 0; k < around; ++k) {
      const double turn = 2 * kPi * (k + 0.5 * (i % 2)) / around;
      mesh.positions.row(i * around + k) << radius * std::cos(turn), radius * std::sin(turn),
          low + (high - low) * i / along;
    }
  mesh.triangles.resize(2 * around * along, 3);
  int j = 0;
  for (int i = 0; i < along; ++i)
    for (int k = 0; k < around; ++k) {
      const int next = (k + 1) % around, a = i * around, b = a + around;
      if (i % 2 == 0) {
        mesh.triangles.row(j++) << a + k, a + next, b + k;
        mesh.triangles.row(j++) << a + next, b + next, b + k;
      } else {
        mesh.triangles.row(j++) << a + k, a + next, b + next;
        mesh.triangles.row(j++) << a + k, b + next, b + k;
      }
    }
  return mesh;
}

/// Bent about the y axis where z > 0, cross-sections as they are.
Positions bent(const Positions& p, double curvature) {
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const double turn = curvature * std::max(0.0, p(v, 2)), radius = 1 / curvature - p(v, 0);
    result.row(v) << 1 / curvature - radius * std::cos(turn), p(v, 1),
        radius * std::sin(turn) + std::min(0.0, p(v, 2));
  }
  return result;
}

/// Bent by linear blend skinning: the skin passes through itself on the inside from some 53° on.
Positions folded(const Positions& p, double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const double share = 1 / (1 + std::exp(-p(v, 2) / 0.25));
    const Eigen::RowVector3d turned(c * p(v, 0) - s * p(v, 2), p(v, 1), s * p(v, 0) + c * p(v, 2));
    result.row(v) += share * (turned - p.row(v));
  }
  return result;
}

struct Worn {
  Worn(const Mesh& body, const Mesh& garment, double gap = -1, Placing placing = Placing::vertices,
       int threads = 1)
      : pool(threads), points(body, garment, {}, pool) {
    TransferOptions options;
    options.placing = placing;
    options.worn = &points;
    options.gap = gap;
    options.threads = threads;
    transfer = std::make_unique<MeshTransfer>(body, garment, points.correspondence(body, garment),
                                              options);
  }
  Positions at(const Positions& pose) { return transfer->apply(pose, false); }
  ThreadPool pool;
  NearestPoints points;
  std::unique_ptr<MeshTransfer> transfer;
};

/// The greatest depth of a garment's vertices and triangle centres inside a body.
double depth(const Mesh& body, const Mesh& garment) {
  const AabbTree tree(body);
  const Positions normals = triangle_normals(body.positions, body.triangles);
  double deepest = 0;
  const auto look = [&](const Eigen::Vector3d& place) {
    // Of several nearest triangles, the one that the place is farthest in front of.
    const PointOnTriangle near = tree.nearest(place, 1e3, [](int) { return true; });
    double height = -1e3;
    tree.nearest(place, std::sqrt(near.squared_distance) + 1e-9, [&](int j) {
      if (nearest_on_triangle(body, j, place).squared_distance <= near.squared_distance + 1e-12)
        height =
            std::max(height, normals.row(j).dot(place.transpose() - near.position.transpose()));
      return false;
    });
    deepest = std::max(deepest, -height);
  };
  for (Index v = 0; v < garment.positions.rows(); ++v) look(garment.positions.row(v).transpose());
  for (Index j = 0; j < garment.triangles.rows(); ++j)
    look(triangle_centre(garment.positions, garment.triangles, j));
  return deepest;
}

/// The greatest distance of the body's vertices outside of a garment.
double standing_out(const Mesh& body, const Mesh& garment) {
  const AabbTree tree(garment);
  const Positions normals = triangle_normals(garment.positions, garment.triangles);
  double farthest = 0;
  for (Index v = 0; v < body.positions.rows(); ++v) {
    const PointOnTriangle near =
        tree.nearest(body.positions.row(v).transpose(), 0.5, [](int) { return true; });
    // Beyond the garment's ends nothing stands out of it.
    if (near.triangle < 0 || near.barycentric.minCoeff() < 1e-6) continue;
    farthest =
        std::max(farthest,
                 normals.row(near.triangle).dot(body.positions.row(v) - near.position.transpose()));
  }
  return farthest;
}

/// A tube whose muscle at (1, 0, 0) bulges by `by`.
Positions flexed(const Positions& p, double by) {
  Positions result = p;
  for (Index v = 0; v < p.rows(); ++v) {
    const Eigen::RowVector3d out = Eigen::RowVector3d(p(v, 0), p(v, 1), 0).normalized();
    const double share = std::exp(-8 * (p.row(v) - Eigen::RowVector3d(1, 0, 0)).squaredNorm());
    result.row(v) += by * share * out;
  }
  return result;
}

}  // namespace

TEST_CASE("a sleeve of another topology bends with an arm at the distance that it had") {
  const Mesh arm = tube(1, -4, 4, 48, 90), sleeve = tube(1.2, -3, 3, 37, 55);
  const Positions truth = bent(sleeve.positions, 0.3);
  const double box = UnitBox(sleeve.positions).scale;
  Worn worn(arm, sleeve);
  CHECK(largest_difference(worn.at(arm.positions), sleeve.positions) < 1e-7 * box);
  const Positions posed = worn.at(bent(arm.positions, 0.3));
  CHECK((posed - truth).rowwise().norm().mean() < 2e-3 * box);
  CHECK(largest_difference(posed, truth) < 1e-2 * box);
  // Gradients alone drift, as (14) leaves all but the mean place to them.
  Worn drifting(arm, sleeve, -1, Placing::components);
  CHECK((drifting.at(bent(arm.positions, 0.3)) - truth).rowwise().norm().mean() >
        3 * (posed - truth).rowwise().norm().mean());
}

TEST_CASE("what is worn moves rigidly with its source, at any gap") {
  const Mesh arm = tube(1, -4, 4, 40, 60), sleeve = tube(1.02, -3, 3, 31, 45);
  const double box = UnitBox(sleeve.positions).scale;
  for (double gap : {-1.0, 0.0, 0.05}) {
    Worn worn(arm, sleeve, gap);
    const test::Affine motion = test::rotation_about(2.1, {1, 2, 3}, {0, 1, 0}, {5, -3, 2});
    CHECK(largest_difference(worn.at(test::transformed(motion, arm.positions)),
                             test::transformed(motion, sleeve.positions)) < 1e-6 * box);
  }
}

TEST_CASE("a garment is kept outside of a bulge below it, and moves no farther than it must") {
  const Mesh body = tube(1, -4, 4, 96, 180);
  Mesh shirt = tube(1.03, -3, 3, 19, 27);
  const double box = UnitBox(shirt.positions).scale;
  const Positions pose = flexed(bent(body.positions, 0.35), 0.5);
  const double rest = depth(body, shirt);
  CHECK(rest == 0);
  Worn free(body, shirt, -1), kept(body, shirt, 0.005);
  const Positions through = free.at(pose), outside = kept.at(pose);
  const Mesh posed{pose, body.triangles};
  CHECK(depth(posed, {through, shirt.triangles}) > 1e-3 * box);
  CHECK(depth(posed, {outside, shirt.triangles}) < 1e-5 * box);
  // The correction is small, too.
  CHECK(largest_difference(through, outside) < 0.05 * box);
}

TEST_CASE("a garment is kept outside of a body that is inside out, too") {
  // A trunk beside the arm, which outward rays from the arm meet.
  const Mesh arm = tube(1, -4, 4, 96, 180), shirt = tube(1.03, -3, 3, 19, 27);
  Mesh trunk = tube(2, -6, 6, 48, 40);
  trunk.positions.col(0).array() += 3.5;
  const test::Affine raised = test::rotation_about(-2, {0, 1, 0}, {0, 0, 4}, {0, 0, 0});
  const Mesh posed = {test::transformed(raised, flexed(arm.positions, 0.5)), arm.triangles};
  Mesh body = test::appended(arm, trunk);
  Positions pose = body.positions;
  pose.topRows(posed.positions.rows()) = posed.positions;
  const double box = UnitBox(shirt.positions).scale;
  for (int side : {1, -1}) {
    CHECK(depth(posed, {Worn(body, shirt, -1).at(pose), shirt.triangles}) > 1e-3 * box);
    CHECK(depth(posed, {Worn(body, shirt, 0.005).at(pose), shirt.triangles}) < 1e-5 * box);
    CHECK(signed_volume(body.positions, body.triangles) * side > 0);
    body.triangles.col(1).swap(body.triangles.col(2));
  }
}

TEST_CASE("the sides of thick cloth are pushed out together, in their order") {
  const Mesh body = tube(1, -3, 3, 80, 60);
  for (const auto& [inner, thick] : {std::pair{1.06, 0.02}, {1.03, 0.01}, {1.06, 0.2}}) {
    const Mesh outside = tube(inner + thick, -2, 2, 60, 40);
    Mesh inside = tube(inner, -2, 2, 60, 40);
    inside.triangles.col(1).swap(inside.triangles.col(2));
    const Mesh cloth = test::appended(outside, inside);
    Worn worn(body, cloth, 0.02);
    const Positions posed = worn.at(flexed(body.positions, 0.5));
    const Index half = outside.positions.rows();
    double least = 1;
    for (Index v = 0; v < half; ++v) {
      const Eigen::RowVector3d out = (posed.row(v) - posed.row(half + v));
      const Eigen::RowVector3d rest = cloth.positions.row(v) - cloth.positions.row(half + v);
      least = std::min(least, out.dot(rest) / rest.squaredNorm());
    }
    INFO(inner << ", " << thick << ": " << least);
    CHECK(least > 0.3);
  }
}

TEST_CASE("bulges between the vertices of a coarse garment lift it") {
  const Mesh body = tube(1, -4, 4, 120, 240), shirt = tube(1.05, -3, 3, 13, 17);
  Positions pose = body.positions;
  for (Index v = 0; v < pose.rows(); ++v) {
    const Eigen::RowVector3d out = Eigen::RowVector3d(pose(v, 0), pose(v, 1), 0).normalized();
    for (double z : {-1.7, 0.1, 1.3})
      pose.row(v) +=
          0.2 *
          std::exp(-200 * (body.positions.row(v) - Eigen::RowVector3d(std::cos(z), std::sin(z), z))
                              .squaredNorm()) *
          out;
  }
  const double box = UnitBox(shirt.positions).scale;
  const Mesh posed{pose, body.triangles};
  const double free = standing_out(posed, {Worn(body, shirt, -1).at(pose), shirt.triangles});
  const double kept = standing_out(posed, {Worn(body, shirt, 0.002).at(pose), shirt.triangles});
  CHECK(standing_out(body, shirt) == 0);
  CHECK(free > 0.02 * box);
  CHECK(kept < 0.05 * free);
}

TEST_CASE("a garment goes on steadily while its source does", "[large]") {
  const Mesh body = tube(1, -4, 4, 48, 90), shirt = tube(1.05, -3, 3, 43, 61);
  Worn worn(body, shirt, 0.01);
  Positions before, pose_before;
  double fastest = 0;
  for (int step = 0; step <= 400; ++step) {
    const double t = step / 400.0;
    const Positions pose = flexed(bent(body.positions, 0.05 + 0.5 * t), 0.8 * t);
    const Positions here = worn.at(pose);
    if (step > 0)
      fastest = std::max(fastest,
                         largest_difference(here, before) / largest_difference(pose, pose_before));
    before = here;
    pose_before = pose;
  }
  CHECK(fastest < 3);
}

TEST_CASE("a garment goes on steadily while its source folds through itself in a joint",
          "[large]") {
  struct Case {
    int around, along;  // of the arm
    double thick;       // of the sleeve
  };
  for (const auto& [around, along, thick] : {Case{40, 64, 0.0}, {160, 256, 0.0}, {40, 64, 0.02}}) {
    const Mesh body = tube(1, -4, 4, around, along);
    Mesh sleeve = tube(1.06 + thick, -2.5, 2.5, 23, 28);
    if (thick > 0) {
      Mesh lining = tube(1.06, -2.5, 2.5, 23, 28);
      lining.triangles.col(1).swap(lining.triangles.col(2));
      sleeve = test::appended(sleeve, lining);
    }
    Worn worn(body, sleeve, 0.02);
    std::vector<Positions> last;  // by one degree each
    double roughest = 0;
    for (int degrees = 30; degrees <= 110; ++degrees) {
      last.push_back(worn.at(folded(body.positions, degrees * kPi / 180)));
      const size_t n = last.size();
      if (n < 3) continue;
      const Positions bend = last[n - 1] - 2 * last[n - 2] + last[n - 3];
      roughest = std::max(roughest, bend.rowwise().norm().maxCoeff());
    }
    INFO(around << ", " << thick << ": " << roughest);
    CHECK(roughest < 0.02);  // 0.1 to 0.25 without outwardness (FarSides)
  }
}

TEST_CASE("props keep their shape and go with what they lie on") {
  const Mesh arm = tube(1, -4, 4, 48, 90);
  // A ring, a button and a long thin strap.
  const Mesh ring = tube(1.1, 1, 1.4, 30, 3);
  Mesh button = test::sphere(2), strap = button;
  button.positions *= 0.1;
  button.positions.col(0).array() += 1.12;
  button.positions.col(2).array() += 2;
  strap.positions = strap.positions * Eigen::Vector3d(0.01, 0.01, 0.8).asDiagonal();
  strap.positions.col(1).array() += 1.05;
  const Mesh props = test::appended(test::appended(ring, button), strap);
  Worn worn(arm, props, -1, Placing::parts);
  const Positions pose = bent(arm.positions, 0.3);
  const Positions posed = worn.at(pose);
  CHECK(largest_difference(worn.at(arm.positions), props.positions) < 1e-9);
  for (Index j = 0; j < props.triangles.rows(); ++j)
    for (int k = 0; k < 3; ++k) {
      const int a = props.triangles(j, k), b = props.triangles(j, (k + 1) % 3);
      CHECK((posed.row(a) - posed.row(b)).norm() ==
            Approx((props.positions.row(a) - props.positions.row(b)).norm()).margin(1e-9));
    }
  // Button and ring move about as the arm does there.
  const Positions truth = bent(props.positions, 0.3);
  const Index first = ring.positions.rows(), last = first + button.positions.rows();
  CHECK(largest_difference(posed.middleRows(first, last - first),
                           truth.middleRows(first, last - first)) < 0.04);
  CHECK(largest_difference(posed.topRows(first), truth.topRows(first)) < 0.1);
}

TEST_CASE("the number of threads changes no bit of what is worn", "[threads]") {
  const Mesh body = tube(1, -4, 4, 96, 90), shirt = tube(1.03, -3, 3, 83, 71);
  const Positions pose = flexed(bent(body.positions, 0.35), 0.5);
  for (Placing placing : {Placing::vertices, Placing::parts}) {
    const Positions one = Worn(body, shirt, 0.005, placing, 1).at(pose);
    CHECK(Worn(body, shirt, 0.005, placing, 3).at(pose) == one);
  }
}
