// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/mesh_transfer.h"

#include <Eigen/Dense>
#include <random>

#include "catch.h"
#include "dense_reference.h"
#include "mesh/unit_box.h"
#include "meshes.h"
#include "support/rotations.h"

using namespace dd;
using test::largest_difference;

namespace {

/// A smooth large deformation: bent about y, twisted and stretched along z.
Positions bent(const Positions& p) {
  Positions result(p.rows(), 3);
  for (Index v = 0; v < p.rows(); ++v) {
    const double x = p(v, 0), y = p(v, 1), z = p(v, 2), a = 0.9 * z, r = 2 + x;
    result.row(v) << r * std::cos(a) - 2 + 0.2 * y * y, y + 0.4 * std::sin(2 * z),
        r * std::sin(a) + 0.3 * z * y;
  }
  return result;
}

MeshTransfer onto(const Mesh& source, const Mesh& target, const TransferOptions& options = {}) {
  return MeshTransfer(source, target, identity_correspondence(source, target), options);
}

Eigen::Vector3d centre(const Positions& p, const Triangles& t, Index j) {
  return (p.row(t(j, 0)) + p.row(t(j, 1)) + p.row(t(j, 2))).transpose() / 3;
}

/// (15) by a matrix inverse, with the unit normals.
Eigen::Matrix3d dense_gradient(const Positions& rest, const Positions& pose, const Triangles& t,
                               Index j) {
  const auto frame = [&](const Positions& p) {
    Eigen::Matrix3d columns;
    columns.col(0) = p.row(t(j, 0)) - p.row(t(j, 2));
    columns.col(1) = p.row(t(j, 1)) - p.row(t(j, 2));
    columns.col(2) = test::triangle_normal(p, t, j);
    return columns;
  };
  return frame(pose) * frame(rest).inverse();
}

std::string refusal(const Mesh& source, const Mesh& target, const Correspondence& correspondence,
                    const TransferOptions& options = {}) {
  try {
    MeshTransfer(source, target, correspondence, options);
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

}  // namespace

TEST_CASE("transferred onto itself a pose comes back") {
  const Mesh mesh = test::rough_sphere(4, 0.2);
  const Positions pose = bent(mesh.positions);
  for (const double unit : {1e-4, 1.0, 1e4}) {
    const Mesh scaled = {unit * mesh.positions, mesh.triangles};
    const double box = bounding_box_diagonal(scaled.positions);
    MeshTransfer transfer = onto(scaled, scaled);
    CHECK(largest_difference(transfer.apply(unit * pose, false), unit * pose) < 1e-9 * box);
    CHECK(largest_difference(transfer.apply(scaled.positions, false), scaled.positions) <
          1e-12 * box);
    CHECK(largest_difference(transfer.apply(scaled.positions, true), scaled.positions) <
          1e-12 * box);
    TransferOptions by_vertex;
    by_vertex.anchor = Anchor::vertices;
    by_vertex.anchors = {17};
    const Positions found = onto(scaled, scaled, by_vertex).apply(unit * pose, false);
    const Eigen::RowVector3d shift = unit * (mesh.positions.row(17) - pose.row(17));
    CHECK(largest_difference(found, (unit * pose).rowwise() + shift) < 1e-9 * box);
  }
}

TEST_CASE("transferred onto a moved, scaled, renumbered copy a pose comes out as moved") {
  Mesh small = test::rough_sphere(2, 0.1);
  small.positions = (0.3 * small.positions).rowwise() + Eigen::RowVector3d(1.5, 0.2, 0.4);
  const Mesh mesh = test::appended(test::rough_sphere(3, 0.2), small);
  const Positions pose = bent(mesh.positions);
  const auto copy = test::renumbered(mesh, std::vector<int>(size_t(mesh.vertex_count()), kFree));
  test::Affine motion = test::rotation_about(2.1, {1, 2, -0.5}, {0, 0, 0}, {3, -1, 7});
  motion.leftCols<3>() *= 2.5;
  Mesh target = copy.mesh;
  target.positions = test::transformed(motion, target.positions);
  Pairs pairs;  // triangles come in reverse order
  const int m = mesh.triangle_count();
  for (int j = 0; j < m; ++j) pairs.push_back({j, m - 1 - j});
  MeshTransfer transfer(mesh, target, triangle_correspondence(pairs, m, m), {});
  const Positions moved = test::transformed(motion, pose), found = transfer.apply(pose, false);
  double worst = 0;
  for (int v = 0; v < mesh.vertex_count(); ++v)
    worst = std::max(worst, (found.row(copy.new_of_old[v]) - moved.row(v)).norm());
  CHECK(worst < 1e-9 * bounding_box_diagonal(target.positions));
  CHECK(transfer.placement().scale == Approx(2.5));

  // Pairs of vertices give the same pairs of triangles.
  Pairs vertices;
  for (int v = 0; v < mesh.vertex_count(); ++v) vertices.push_back({v, copy.new_of_old[v]});
  const Correspondence found_triangles = vertex_correspondence(vertices, mesh, target);
  for (int j = 0; j < m; ++j) {
    REQUIRE(found_triangles.begin[size_t(j) + 1] - found_triangles.begin[j] == 1);
    CHECK(found_triangles.source[found_triangles.begin[j]] == m - 1 - j);
  }
}

TEST_CASE("onto another rest shape: the same as a dense solve, and near the volumetric original") {
  const Mesh source = test::rough_sphere(3, 0.15);
  Mesh target = test::rough_sphere(3, 0.2, 31);
  target.positions.col(2) *= 1.6;
  const Positions pose = bent(source.positions);
  const int n = target.vertex_count(), m = target.triangle_count();
  // One or two sources for each triangle.
  std::mt19937 random(4);
  Pairs pairs;
  for (int j = 0; j < m; ++j) {
    pairs.push_back({j, j});
    if (j % 3 == 0) pairs.push_back({(j + 1 + int(random() % 4)) % m, j});
  }
  const Correspondence correspondence = triangle_correspondence(pairs, m, m);
  const Similarity upright;
  TransferOptions options;
  options.anchor = Anchor::pinned;
  options.anchors = {3, 100, 101};
  options.placement = &upright;
  Positions places(3, 3);
  for (int i = 0; i < 3; ++i)
    places.row(i) =
        target.positions.row(options.anchors[size_t(i)]) + Eigen::RowVector3d(0.1 * i, 0.05, -0.1);

  const auto dense = test::dense_operators(target.positions, target.triangles);
  for (const bool rotation_only : {false, true}) {
    Eigen::MatrixXd gradients(3 * m, 3);
    for (int j = 0; j < m; ++j) {
      Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
      const int first = correspondence.begin[j], end = correspondence.begin[size_t(j) + 1];
      for (int k = first; k < end; ++k) {
        const Eigen::Matrix3d S =
            dense_gradient(source.positions, pose, source.triangles, correspondence.source[k]);
        mean += (rotation_only ? polar_rotation(S) : S) / (end - first);
      }
      // The mean of two rotations by quaternions is also the rotation nearest to their sum.
      gradients.middleRows<3>(3 * j) = (rotation_only ? polar_rotation(mean) : mean).transpose();
    }
    Eigen::MatrixXd L = dense.L, right = dense.G.transpose() * dense.D * gradients;
    for (int i = 0; i < 3; ++i) {
      const int v = options.anchors[size_t(i)];
      L.row(v).setZero();
      L(v, v) = 1;
      right.row(v) = places.row(i);
    }
    const Positions expected = L.partialPivLu().solve(right);
    MeshTransfer transfer(source, target, correspondence, options);
    CHECK(largest_difference(transfer.apply(pose, rotation_only, &places), expected) < 1e-9);
    CHECK(transfer.unknowns() == n - 3);

    TransferOptions volumetric = options;
    volumetric.formulation = Formulation::fourth_points;
    MeshTransfer original(source, target, correspondence, volumetric);
    const double box = bounding_box_diagonal(target.positions);
    CHECK(largest_difference(original.apply(pose, rotation_only, &places), expected) < 0.02 * box);
    CHECK(original.unknowns() == n - 3 + m);
    CHECK(original.nonzeros() > 2 * transfer.nonzeros());
  }
}

TEST_CASE("the volumetric original gives a pose back too") {
  const Mesh mesh = test::rough_sphere(3, 0.2);
  const Positions pose = bent(mesh.positions);
  for (const Formulation formulation :
       {Formulation::fourth_points, Formulation::fourth_points_unweighted}) {
    TransferOptions options;
    options.formulation = formulation;
    // Fourth points use e1 × e2 / √|e1 × e2|, S_j of (15) the unit normal: they differ where a pose
    // stretches, but not for a rigid motion.
    const test::Affine rigid = test::rotation_about(1.3, {1, -1, 2}, {0, 0, 0}, {0.3, 4, 1});
    const Positions moved = test::transformed(rigid, mesh.positions);
    MeshTransfer transfer = onto(mesh, mesh, options);
    CHECK(largest_difference(transfer.apply(moved, false), moved) < 1e-9);
    CHECK(largest_difference(transfer.apply(pose, false), pose) < 1e-2);
  }
}

TEST_CASE("a rigid motion carries over by any correspondence") {
  const Mesh source = test::rough_sphere(2, 0.3), target = test::rough_sphere(3, 0.2, 5);
  const test::Affine rigid = test::rotation_about(2.6, {1, 3, 2}, {1, 0, 0}, {0.3, 4, 1});
  std::mt19937 random(9);
  Pairs pairs;
  for (int i = 0; i < 300; ++i)
    pairs.push_back({int(random() % unsigned(source.triangle_count())),
                     int(random() % unsigned(target.triangle_count()))});
  const Similarity as_they_are;
  TransferOptions options;
  options.placement = &as_they_are;
  MeshTransfer transfer(
      source, target,
      triangle_correspondence(pairs, source.triangle_count(), target.triangle_count()), options);
  CHECK(transfer.gradients().unmatched_count() > 200);
  const Positions expected = test::transformed(rigid, target.positions);
  for (const bool rotation_only : {false, true})
    CHECK(largest_difference(
              transfer.apply(test::transformed(rigid, source.positions), rotation_only), expected) <
          1e-9);
}

TEST_CASE(
    "anchors: the centre, a group's mean or pinned vertices stay, or go where they are told") {
  const Mesh mesh = test::rough_sphere(3, 0.2);
  const Positions pose = bent(mesh.positions).rowwise() + Eigen::RowVector3d(5, 5, 5);
  TransferOptions options;
  options.anchor = Anchor::centroid;
  const Positions centred = onto(mesh, mesh, options).apply(pose, false);
  const auto mean = [&](const Positions& p) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    double area = 0;
    for (Index j = 0; j < mesh.triangles.rows(); ++j) {
      const Eigen::Vector3d a = mesh.positions.row(mesh.triangles(j, 0)),
                            b = mesh.positions.row(mesh.triangles(j, 1)),
                            c = mesh.positions.row(mesh.triangles(j, 2));
      const double of_this = 0.5 * (b - a).cross(c - a).norm();
      sum += of_this * centre(p, mesh.triangles, j);
      area += of_this;
    }
    return Eigen::Vector3d(sum / area);
  };
  CHECK((mean(centred) - mean(mesh.positions)).norm() < 1e-9);

  options.anchor = Anchor::vertices;
  options.anchors = {1, 7, 50};
  Positions places(3, 3);
  places << 1, 0, 0, 0, 2, 0, 0, 0, 3;
  MeshTransfer by_group = onto(mesh, mesh, options);
  const Positions placed = by_group.apply(pose, false, &places);
  const Eigen::RowVector3d group = (placed.row(1) + placed.row(7) + placed.row(50)) / 3;
  CHECK((group - places.colwise().mean()).norm() < 1e-9);

  options.anchor = Anchor::pinned;
  const Positions pinned = onto(mesh, mesh, options).apply(pose, false);
  for (int v : options.anchors) CHECK(pinned.row(v) == mesh.positions.row(v));
}

TEST_CASE("loose parts move with their sources, parts without one with the others' mean") {
  const Mesh ball = test::rough_sphere(2, 0.2);
  const auto at = [&](double x) {
    return Mesh{ball.positions.rowwise() + Eigen::RowVector3d(x, 0, 0), ball.triangles};
  };
  const Mesh source = test::appended(at(0), at(3));
  const Mesh target = test::appended(source, at(6));
  Pairs pairs;
  for (int j = 0; j < source.triangle_count(); ++j) pairs.push_back({j, j});
  const Correspondence correspondence =
      triangle_correspondence(pairs, source.triangle_count(), target.triangle_count());
  Positions pose = source.positions;
  const int n = ball.vertex_count();
  pose.topRows(n).rowwise() += Eigen::RowVector3d(0, 0, 1);
  pose.bottomRows(n).rowwise() += Eigen::RowVector3d(0, 0, 3);

  MeshTransfer free_parts(source, target, correspondence, {});
  CHECK(free_parts.unmatched_component_count() == 1);
  CHECK(free_parts.unmatched_component_example() == 2 * n);
  Positions found = free_parts.apply(pose, true) - target.positions;
  CHECK(largest_difference(found.topRows(n), Eigen::RowVector3d(0, 0, 1).replicate(n, 1)) < 1e-9);
  CHECK(largest_difference(found.middleRows(n, n), Eigen::RowVector3d(0, 0, 3).replicate(n, 1)) <
        1e-9);
  CHECK(largest_difference(found.bottomRows(n), Eigen::RowVector3d(0, 0, 2).replicate(n, 1)) <
        1e-9);

  // A pinned part stays, and the others keep their distance from it.
  TransferOptions options;
  options.anchor = Anchor::pinned;
  options.anchors = {0};
  found =
      MeshTransfer(source, target, correspondence, options).apply(pose, true) - target.positions;
  CHECK(largest_difference(found.topRows(n), Positions::Zero(n, 3)) < 1e-9);
  CHECK(largest_difference(found.middleRows(n, n), Eigen::RowVector3d(0, 0, 2).replicate(n, 1)) <
        1e-9);
}

TEST_CASE("degenerate triangles and loose vertices on either side leave a finite, sensible pose") {
  Mesh mesh = test::rough_sphere(3, 0.1);
  mesh.positions.row(mesh.triangles(10, 0)) = mesh.positions.row(mesh.triangles(10, 1));
  mesh.positions.conservativeResize(mesh.positions.rows() + 1, 3);
  mesh.positions.bottomRows(1) << 0.1, 0.2, 0.3;
  MeshTransfer transfer = onto(mesh, mesh);
  CHECK(!transfer.degenerate_triangles().empty());
  CHECK(transfer.isolated_count() == 1);
  const test::Affine rigid = test::rotation_about(1.1, {1, -1, 2}, {0, 0, 0}, {0.3, 4, 1});
  Positions moved = test::transformed(rigid, mesh.positions);
  Positions found = transfer.apply(moved, false);
  moved.bottomRows(1) = mesh.positions.bottomRows(1);  // a vertex without triangles stays
  CHECK(largest_difference(found, moved) < 1e-9);
  const Positions pose = bent(mesh.positions);
  CHECK(largest_difference(transfer.apply(pose, false).topRows(100), pose.topRows(100)) < 0.02);
}

TEST_CASE("the number of threads changes no bit of a transferred pose", "[threads]") {
  const Mesh mesh = test::rough_sphere(5, 0.1);
  TransferOptions options;
  options.threads = 1;
  const Positions alone = onto(mesh, mesh, options).apply(bent(mesh.positions), true);
  options.threads = 3;
  CHECK(alone == onto(mesh, mesh, options).apply(bent(mesh.positions), true));
}

TEST_CASE("unusable transfers, poses and correspondences are refused with a message") {
  const Mesh mesh = test::rough_sphere(1, 0.1), other = test::rough_sphere(2, 0.1);
  const Correspondence same = identity_correspondence(mesh, mesh);
  const int m = mesh.triangle_count();
  CHECK_THAT(refusal(mesh, other, same), contains("The correspondences are for"));
  Mesh broken = mesh;
  broken.positions(4, 1) = std::nan("");
  CHECK_THAT(refusal(broken, mesh, same), contains("Vertex 4 of the source has"));
  CHECK_THAT(refusal(mesh, broken, same), contains("Vertex 4 of the target has"));
  Correspondence none;
  none.begin.assign(size_t(m) + 1, 0);
  CHECK_THAT(refusal(mesh, mesh, none), contains("No triangle of the target corresponds"));
  TransferOptions options;
  options.anchor = Anchor::pinned;
  CHECK_THAT(refusal(mesh, mesh, same, options), contains("no anchor"));
  options.anchors = {0, 0};
  CHECK_THAT(refusal(mesh, mesh, same, options), contains("more than once"));
  options.anchors = {0, 999};
  CHECK_THAT(refusal(mesh, mesh, same, options), contains("Anchor 999"));
  options.anchors.resize(size_t(mesh.vertex_count()));
  std::iota(options.anchors.begin(), options.anchors.end(), 0);
  CHECK_THAT(refusal(mesh, mesh, same, options), contains("Every vertex is pinned"));

  MeshTransfer transfer = onto(mesh, mesh);
  CHECK_THROWS_WITH(transfer.apply(other.positions, true), contains("The pose has"));
  CHECK_THROWS_WITH(transfer.apply(broken.positions, true),
                    contains("Vertex 4 of the source is not finite in the pose"));
  CHECK_THROWS_WITH(identity_correspondence(mesh, other), contains("not of the same topology"));
  Mesh turned = mesh;
  turned.triangles.row(5) = mesh.triangles.row(5).reverse().eval();
  CHECK_THROWS_WITH(identity_correspondence(mesh, turned), contains("Triangle 5"));
  CHECK_THROWS_WITH(triangle_correspondence({}, m, m), contains("no pair"));
  CHECK_THROWS_WITH(triangle_correspondence({{0, 0}, {m, 1}}, m, m), contains("Pair 1 names"));
  CHECK_THROWS_WITH(vertex_correspondence({{0, 999}}, mesh, mesh), contains("of the target"));
}

TEST_CASE("a target that stands otherwise turns the deformations, one of another shape doesn't") {
  const Mesh mesh = test::rough_sphere(3, 0.2);
  const Correspondence same = identity_correspondence(mesh, mesh);
  const auto placed = [&](double angle, double sheared) {
    Mesh target = mesh;
    const Eigen::Matrix3d turn = rotation_by(angle * Eigen::Vector3d(1, 0, 0));
    target.positions *= turn.transpose();
    target.positions.col(0) += sheared * target.positions.col(1);
    return fitted_placement(mesh, target, same).rotation;
  };
  const double degree = std::acos(-1.0) / 180;
  CHECK(placed(8 * degree, 0).isApprox(rotation_by({8 * degree, 0, 0}), 1e-9));
  CHECK(placed(0, 0.05).isIdentity(1e-12));
  CHECK(placed(90 * degree, 0.05).isApprox(rotation_by({90 * degree, 0, 0}), 1e-9));
  // At any turn the fitted rotation errs by less than 60 degrees times the shear.
  for (const double sheared : {0.05, 0.1, 0.2})
    for (const double angle : {15 * degree, 35 * degree, 75 * degree}) {
      const Eigen::Matrix3d beside = rotation_by({-angle, 0, 0}) * placed(angle, sheared);
      CHECK(rotation_vector(beside).norm() < 60 * degree * sheared);
    }
}

TEST_CASE("a longer neck doesn't turn the body that it is on") {
  // A ball with a horn: the target's longer horn moves its centre but turns few normals.
  const Mesh source = test::rough_sphere(4, 0.02);
  Mesh target = source;
  for (Index v = 0; v < target.positions.rows(); ++v) {
    const Eigen::RowVector3d p = source.positions.row(v);
    const double near = std::max(0.0, p.dot(Eigen::RowVector3d(0.7, 0.7, 0)) - 0.8);
    target.positions.row(v) += 8 * near * Eigen::RowVector3d(0, 1, 0);
  }
  const Correspondence same = identity_correspondence(source, target);
  CHECK(fitted_placement(source, target, same).rotation.isIdentity(1e-12));
  const Eigen::Matrix3d turn = rotation_by({0.1, 0.2, -0.1});
  target.positions *= turn.transpose();
  const Eigen::Matrix3d beside = turn.transpose() * fitted_placement(source, target, same).rotation;
  CHECK(rotation_vector(beside).norm() < 0.05);
}

TEST_CASE("triangles that a pose collapses turn with their neighbours") {
  const Mesh mesh = test::rough_sphere(4, 0.05);
  MeshTransfer transfer = onto(mesh, mesh);
  const auto squeezed = [&](double height) {  // a cap pressed flat against a line
    Positions pose = bent(mesh.positions);
    for (Index v = 0; v < pose.rows(); ++v)
      if (mesh.positions(v, 0) > 0.8)
        pose.row(v) << pose(v, 0), height * pose(v, 1), 0.3 + height * pose(v, 2);
    return pose;
  };
  // The rotations of the squeezed triangles are rounding alone, which must not show.
  const Positions quite = transfer.apply(squeezed(0), true);
  CHECK(largest_difference(transfer.apply(squeezed(1e-9), true), quite) < 1e-6);
  const Positions nothing = Positions::Zero(mesh.positions.rows(), 3);
  const Positions stays = transfer.apply(nothing, true);
  const Eigen::RowVector3d shift = stays.row(0) - mesh.positions.row(0);
  CHECK(largest_difference(stays, mesh.positions.rowwise() + shift) < 1e-9);
}

TEST_CASE(
    "rotations alone are refused where places need whole gradients, and taken where they don't") {
  const Mesh mesh = test::rough_sphere(2, 0.2);
  const Positions pose = bent(mesh.positions);
  for (const Placing placing :
       {Placing::vertices, Placing::components, Placing::parts, Placing::displacements}) {
    TransferOptions options;
    options.placing = placing;
    MeshTransfer transfer = onto(mesh, mesh, options);
    CHECK(transfer.apply(pose, false).allFinite());
    if (placing == Placing::components || placing == Placing::parts)
      CHECK(transfer.apply(pose, true).allFinite());
    else
      CHECK_THROWS_WITH(transfer.apply(pose, true), contains("need whole gradients"));
  }
}

TEST_CASE("a mirror image is deformed as one") {
  const Mesh source = test::rough_sphere(4, 0.2);
  const Positions pose = bent(source.positions);
  CHECK(!onto(source, source).mirrored());
  // A plane's image, turned and scaled: x -> 1.7 R (I - 2 n nᵀ) x + t.
  const Eigen::Vector3d n = Eigen::Vector3d(1, 0.4, -0.2).normalized(), shift(3, -1, 5);
  const double scale = 1.7;
  const Eigen::Matrix3d turn = rotation_by({0.3, 1.1, -0.5}),
                        reflection = turn * (Eigen::Matrix3d::Identity() - 2 * n * n.transpose());
  const auto image = [&](const Positions& p) -> Positions {
    return (scale * p * reflection.transpose()).rowwise() + shift.transpose();
  };
  Mesh target = {image(source.positions), source.triangles};
  const double box = bounding_box_diagonal(target.positions);
  for (const bool turned_over : {false, true}) {
    if (turned_over) target.triangles.col(1).swap(target.triangles.col(2));
    Pairs pairs;
    for (int j = 0; j < source.triangle_count(); ++j) pairs.push_back({j, j});
    const Correspondence each =
        triangle_correspondence(pairs, source.triangle_count(), target.triangle_count());
    for (const Formulation formulation : {Formulation::surface, Formulation::fourth_points})
      for (const Placing placing : {Placing::vertices, Placing::components}) {
        TransferOptions options;
        options.formulation = formulation;
        options.placing = placing;
        MeshTransfer transfer(source, target, each, options);
        CHECK(transfer.mirrored());
        CHECK((transfer.placement().rotation - reflection).norm() < 1e-9);
        CHECK(largest_difference(transfer.apply(pose, false), image(pose)) < 1e-5 * box);

        if (placing == Placing::components) {
          // With rotations alone it is the image of the source's transfer onto itself.
          MeshTransfer itself(source, source, each, options);
          const Positions own = itself.apply(pose, true);
          CHECK(largest_difference(transfer.apply(pose, true), image(own)) < 1e-5 * box);
        }

        const Similarity found = transfer.placement();
        options.placement = &found;
        CHECK(MeshTransfer(source, target, each, options).mirrored());
      }
  }
}

TEST_CASE("a mirror image of another shape is recognized, a nearly flat shape is none") {
  const Mesh source = test::rough_sphere(4, 0.2);
  Mesh target = source;
  target.positions.col(0) *= -1;
  for (Index v = 0; v < target.positions.rows(); ++v)
    target.positions.row(v) *= 1 + 0.1 * std::sin(3 * target.positions(v, 1));
  CHECK(onto(source, target).mirrored());

  const Mesh sheet = test::grid(20, 20, [](double x, double y) { return 0.2 * x * y; });
  Mesh other = sheet;  // bent the other way, and with waves that no reflection explains
  for (Index v = 0; v < other.positions.rows(); ++v)
    other.positions(v, 2) =
        -0.02 * other.positions(v, 2) + 0.1 * std::sin(9 * other.positions(v, 0));
  CHECK(!onto(sheet, other).mirrored());
}

TEST_CASE("anchors without a triangle don't move the rest") {
  Mesh mesh = test::rough_sphere(2, 0.2);
  mesh.positions.conservativeResize(mesh.positions.rows() + 1, 3);
  mesh.positions.bottomRows(1) << 5, 5, 5;
  TransferOptions options;
  options.anchor = Anchor::vertices;
  options.anchors = {0, mesh.vertex_count() - 1};
  Positions places(2, 3);
  places << 1, 2, 3, 9, 9, 9;
  const Positions found = onto(mesh, mesh, options).apply(bent(mesh.positions), true, &places);
  CHECK((found.row(0) - places.row(0)).norm() < 1e-9);
  CHECK(found.bottomRows(1) == mesh.positions.bottomRows(1));
}
