// SPDX-License-Identifier: GPL-3.0-or-later
// Transfers by the source's places besides its gradients, contacts that close, and slivers.
#include <algorithm>
#include <map>
#include <numeric>
#include <random>

#include "catch.h"
#include "deform/mesh_transfer.h"
#include "faces.h"
#include "match/points_of_fit.h"
#include "match/registration.h"
#include "match/triangle_match.h"
#include "mesh/point_grid.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "meshes.h"
#include "random_meshes.h"
#include "support/rotations.h"
#include "transfer/contacts.h"

using namespace dd;
using test::largest_difference;
using test::Lids;

namespace {

MeshTransfer onto(const Mesh& source, const Mesh& target, Placing placing) {
  TransferOptions options;
  options.placing = placing;
  return MeshTransfer(source, target, identity_correspondence(source, target), options);
}

Positions arched(const Positions& p) {
  Positions result(p.rows(), 3);
  for (Index v = 0; v < p.rows(); ++v) {
    const double a = 0.9 * p(v, 2), r = 2 + p(v, 0);
    result.row(v) << r * std::cos(a) - 2, p(v, 1) + 0.3 * std::sin(2 * p(v, 2)), r * std::sin(a);
  }
  return result;
}

}  // namespace

TEST_CASE("a grid finds each pair within reach once, as a search through all does") {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> anywhere(-1, 1);
  Positions points(600, 3);
  for (double& value : points.reshaped()) value = anywhere(random);
  points.bottomRows(50) *= 1e7;
  points.row(17) = points.row(18);
  std::vector<int> chosen;
  for (int i = 0; i < 600; i += 1 + i % 3) chosen.push_back(i);
  ThreadPool pool(2);
  for (const double reach : {0.05, 0.4, 3.0}) {
    const PointGrid grid(points, chosen, reach, pool);
    REQUIRE(grid.count() == int(chosen.size()));
    std::map<std::pair<int, int>, int> times;
    for (int k = 0; k < grid.count(); ++k)
      grid.near_after(k, 1000, [&](int l, double squared) {
        ++times[std::minmax(grid.point(k), grid.point(l))];
        CHECK(squared ==
              Approx((points.row(grid.point(l)) - points.row(grid.point(k))).squaredNorm()));
      });
    for (int i : chosen)
      for (int j : chosen)
        if (i < j) CHECK(times[{i, j}] == int((points.row(i) - points.row(j)).norm() < reach));
  }
}

TEST_CASE("a grid with a limit of neighbours samples a crowd evenly, across cells too") {
  constexpr int kCount = 4000;
  Positions points = 0.01 * Positions::Random(kCount, 3);
  points.bottomRows(kCount / 2).col(2).array() += 0.5;
  std::vector<int> all(kCount), times(kCount, 0);
  std::iota(all.begin(), all.end(), 0);
  points.row(0) << 0, 0, -0.7;  // cells of size 1 begin here, so that each heap is in another
  ThreadPool pool(2);
  const PointGrid grid(points, all, 1, pool);
  int pairs = 0;
  for (int k = 0; k < grid.count(); ++k)
    grid.near_after(k, 40, [&](int l, double) {
      for (int i : {k, l}) ++times[grid.point(i)];
      ++pairs;
    });
  CHECK(pairs > 20 * kCount);
  CHECK(pairs < 80 * kCount);
  CHECK(*std::max_element(times.begin(), times.end()) < 12 * pairs / kCount);
}

TEST_CASE("contacts equal their formula over all pairs") {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> anywhere(0, 1);
  constexpr int kCount = 200;
  constexpr double kReach = 0.12;
  Positions rest(kCount, 3), posed(kCount, 3), placed(kCount, 3);
  for (Positions* p : {&rest, &posed, &placed})
    for (double& value : p->reshaped()) value = anywhere(random);
  const bool few_move = GENERATE(false, true);
  if (few_move) {  // towards points that rest
    posed = rest;
    for (int i = 0; i < 12; ++i) posed.row(i) += 0.95 * (rest.row(i + 100) - rest.row(i));
  }
  placed = posed + 0.05 * placed;
  std::vector<int> parts(kCount, 1);
  parts[3] = parts[77] = -1;
  for (int i = 150; i < kCount; ++i) parts[i] = 0;
  ThreadPool pool(2);
  Contacts contacts(rest, parts, Eigen::VectorXd::Ones(kCount), kReach);
  REQUIRE(contacts.find_closing(posed, pool));
  const Rows found = contacts.closing_displacements(posed, placed, pool);

  const auto risen = [](double t) { return t <= 0 ? 0 : t >= 1 ? 1 : 3 * t * t - 2 * t * t * t; };
  int closing = 0;
  for (int i = 0; i < kCount; ++i) {
    double sum = 0, most = 0;
    Eigen::RowVector3d mean = Eigen::RowVector3d::Zero();
    for (int j = 0; j < kCount; ++j) {
      if (i == j || parts[i] < 0 || parts[i] != parts[j]) continue;
      const double a = (rest.row(i) - rest.row(j)).norm(), b = (posed.row(i) - posed.row(j)).norm();
      const double c =
          risen(1 - b / kReach) * risen(1 - 2 * b / a) * risen(2 * (a - b) / kReach - 1);
      sum += c;
      most = std::max(most, c);
      mean += c * (posed.row(j) - placed.row(j));
    }
    if (sum == 0) {
      CHECK(found.row(i).norm() == 0);
      continue;
    }
    ++closing;
    const Eigen::RowVector3d e = 0.5 * (posed.row(i) - placed.row(i) - mean / sum);
    const double share = most / (1 + std::pow(e.norm() / (4 * kReach), 4));
    CHECK(found(i, 3) == Approx(share));
    CHECK((found.row(i).head<3>() - share * e).norm() < 1e-7);  // shares are floats
  }
  CHECK(closing > 20);
}

TEST_CASE(
    "contacts in a crowd are sampled, and samples stand for points denser than a contact's "
    "reach") {
  std::mt19937 random(8);
  std::uniform_real_distribution<double> anywhere(0, 1);
  constexpr int kCount = 40000;
  Positions rest(kCount, 3);
  for (double& value : rest.reshaped()) value = anywhere(random);
  ThreadPool pool(2);
  Contacts contacts(rest, std::vector<int>(kCount, 0), Eigen::VectorXd::Ones(kCount), 0.01);
  Positions two_heaps = 1e-6 * rest;
  two_heaps.topRows(kCount / 2).col(0).array() += 0.012;
  // All within reach of all; and two heaps in neighbouring cells, out of reach of each other.
  for (const Positions& heap : {Positions(1e-6 * rest), Positions(0.01 * rest), two_heaps}) {
    REQUIRE(contacts.find_closing(heap, pool));
    const Rows found = contacts.closing_displacements(heap, rest, pool);
    CHECK(found.allFinite());
    CHECK(int((found.col(3).array() > 0).count()) >
          int(0.995 * kCount));  // others stand for the rest
  }

  // Two sheets that close, of ten thousand points or of forty: the same share of the mass is moved
  // by the same vector.
  const auto moved = [&](int side) {
    const Mesh sheet = test::grid(side, side, [](double, double) { return 0.0; });
    Positions open(2 * side * side, 3), closed, placed;
    open << sheet.positions, sheet.positions.rowwise() + Eigen::RowVector3d(0, 0, 0.1);
    closed = open;
    closed.bottomRows(side * side).col(2).array() -= 0.095;
    placed = closed;
    placed.bottomRows(side * side).col(2).array() += 0.01;
    Contacts both(open, std::vector<int>(size_t(open.rows()), 0),
                  Eigen::VectorXd::Constant(open.rows(), 1.0 / (side * side)), 0.03);
    REQUIRE(both.find_closing(closed, pool));
    const Rows found = both.closing_displacements(closed, placed, pool) / (side * side);
    return Eigen::Vector2d(found.topRows(side * side).col(2).sum(),
                           found.topRows(side * side).col(3).sum());
  };
  const Eigen::Vector2d coarse = moved(100), fine = moved(200);
  CHECK(coarse[0] / coarse[1] == Approx(0.005).epsilon(0.01));
  CHECK(fine[0] / fine[1] == Approx(0.005).epsilon(0.01));
  CHECK(fine[1] == Approx(coarse[1]).epsilon(0.02));
}

TEST_CASE("places of the source change nothing where gradients give them already") {
  const Mesh mesh = test::rough_sphere(4, 0.2);
  const double box = bounding_box_diagonal(mesh.positions);
  const Positions pose = arched(mesh.positions);
  for (const double unit : {1e-4, 1.0, 1e4}) {
    const Mesh scaled = {unit * mesh.positions, mesh.triangles};
    MeshTransfer itself = onto(scaled, scaled, Placing::vertices);
    CHECK(largest_difference(itself.apply(unit * pose, false), unit * pose) < 1e-9 * unit * box);
  }

  // A rigid motion is carried over to another shape as gradients alone carry it.
  Mesh other = test::rough_sphere(4, 0.15, 3);
  other.positions.col(1) *= 1.4;
  const Positions moved =
      test::transformed(test::rotation_about(2.6, {1, 3, 2}, {1, 0, 0}, {3, 4, 1}), mesh.positions);
  CHECK(largest_difference(onto(mesh, other, Placing::vertices).apply(moved, false),
                           onto(mesh, other, Placing::components).apply(moved, false)) <
        1e-9 * box);
  const Positions rest = onto(mesh, other, Placing::vertices).apply(mesh.positions, false);
  CHECK(largest_difference(rest, other.positions) < 1e-12 * box);
}

TEST_CASE(
    "a part of the surface goes where its source goes, though integrated gradients go elsewhere") {
  // A bulge slides along a sheet; the target's sheet is the source's, its middle stretched.
  const int side = 61;
  const Mesh source = test::grid(side, side, [](double, double) { return 0.0; });
  Mesh target = source;
  for (Index v = 0; v < target.positions.rows(); ++v)
    target.positions(v, 0) += 0.01 * std::sin(6.28 * target.positions(v, 0));
  Positions pose = source.positions;
  for (Index v = 0; v < pose.rows(); ++v) {
    const double d = (source.positions.row(v).head<2>() - Eigen::RowVector2d(0.5, 0.5)).norm();
    pose(v, 0) += 0.05 * std::exp(-d * d / 0.02);
  }
  const Positions wanted = target.positions + pose - source.positions;
  const auto off = [&](Placing placing) {
    return largest_difference(onto(source, target, placing).apply(pose, false), wanted);
  };
  CHECK(off(Placing::vertices) < 0.5 * off(Placing::components));
}

TEST_CASE("lids that close on the source close on a target whose gap is wider") {
  const Lids source(0.04), target(0.05);
  const double box = bounding_box_diagonal(target.mesh.positions);
  MeshTransfer follows = onto(source.mesh, target.mesh, Placing::vertices);
  MeshTransfer gradients_alone = onto(source.mesh, target.mesh, Placing::components);
  const Positions closed = Lids::closed(source.mesh.positions, 0.039);
  const double gap = Lids::gap(closed);
  CHECK(gap < 0.0011);
  CHECK(Lids::gap(gradients_alone.apply(closed, false)) > 8 * gap);
  CHECK(Lids::gap(follows.apply(closed, false)) < 2 * gap);
  // Both lids give way, and the sheet's far borders hardly do.
  const Positions found = follows.apply(closed, false);
  const int lower = Lids::kColumns / 2 * Lids::kRows + Lids::kRows - 1;
  CHECK(found(lower, 1) - target.mesh.positions(lower, 1) > 0.002);
  for (int i = 0; i < Lids::kColumns; ++i)
    CHECK((found.row(i * Lids::kRows) - target.mesh.positions.row(i * Lids::kRows)).norm() <
          0.002 * box);

  // Step by step the target moves as steadily as the source.
  constexpr int kSteps = 200;
  Positions last = target.mesh.positions;
  double largest = 0;
  for (int k = 1; k <= kSteps; ++k) {
    const Positions now =
        follows.apply(Lids::closed(source.mesh.positions, 0.039 * k / kSteps), false);
    largest = std::max(largest, largest_difference(now, last));
    last = now;
  }
  CHECK(largest < 6 * 0.039 / kSteps);
}

TEST_CASE("an eye of another size turns about its own centre and stays round") {
  const Mesh ball = test::sphere(3);
  Mesh face = test::grid(41, 41, [](double, double) { return 0.0; });
  face.positions = (face.positions.rowwise() - Eigen::RowVector3d(0.5, 0.5, 0)) * 10;
  const Index first = face.positions.rows();
  const auto with_eye = [&](double size, const Eigen::RowVector3d& centre) {
    Mesh eye = ball;
    eye.positions = (size * ball.positions).rowwise() + centre;
    return test::appended(face, eye);
  };
  const Eigen::RowVector3d place(0.5, 0, 0.3), own(0.6, 0.05, 0.3);
  const Mesh source = with_eye(0.5, place), target = with_eye(0.6, own);
  Positions pose = source.positions;
  const Eigen::Matrix3d turn = rotation_by({0, 0.5, 0});
  pose.bottomRows(ball.vertex_count()) =
      (0.5 * ball.positions * turn.transpose()).rowwise() + place;
  const Positions found = onto(source, target, Placing::vertices).apply(pose, false);
  const Positions eye = found.bottomRows(ball.vertex_count());
  const double box = bounding_box_diagonal(target.positions);
  const Positions by_gradients = onto(source, target, Placing::components).apply(pose, false);
  CHECK((eye.colwise().mean() - own).norm() <
        0.05 * (by_gradients.bottomRows(ball.vertex_count()).colwise().mean() - own).norm());
  const Positions turned =
      (0.6 * ball.positions * turn.transpose()).rowwise() + eye.colwise().mean();
  CHECK(largest_difference(eye, turned) < 1e-4 * box);
  CHECK(largest_difference(found.topRows(first), face.positions) < 1e-6 * box);
}

TEST_CASE("a sliver of the source doesn't decide how a region of the target deforms") {
  Mesh source = test::rough_sphere(4, 0.05);
  // A vertex beside an edge makes its triangle a sliver, which grows in the pose.
  const Eigen::RowVector3i t = source.triangles.row(900);
  const Positions& p = source.positions;
  const Eigen::RowVector3d middle = 0.5 * (p.row(t[0]) + p.row(t[1]));
  const double edge = (p.row(t[0]) - p.row(t[1])).norm();
  source.positions.row(t[2]) = middle + 0.03 * (p.row(t[2]) - middle);
  Positions pose = source.positions;
  pose.row(t[2]) += 15 * 0.03 * edge * (p.row(t[2]) - middle).normalized();
  const double moved = largest_difference(pose, source.positions);

  const Mesh target = test::rough_sphere(4, 0.04, 3);
  Pairs pairs;
  const Eigen::RowVector3d about = target.positions.row(target.triangles(900, 0));
  int served = 0;
  for (int j = 0; j < target.triangle_count(); ++j) {
    const bool near = (target.positions.row(target.triangles(j, 0)) - about).norm() < 0.35;
    served += near;
    pairs.push_back({near ? 900 : j, j});
  }
  REQUIRE(served > 30);
  const auto correspondence =
      triangle_correspondence(pairs, source.triangle_count(), target.triangle_count());
  for (const Placing placing : {Placing::components, Placing::vertices}) {
    TransferOptions options;
    options.placing = placing;
    MeshTransfer transfer(source, target, correspondence, options);
    CHECK(transfer.gradients().overstretched_count() == 1);
    CHECK(transfer.gradients().overstretched_example() == 900);
    CHECK(largest_difference(transfer.apply(pose, false), target.positions) < 1.5 * moved);
  }
  // Where each triangle is its own source nothing is replaced.
  CHECK(onto(source, target, Placing::components).gradients().overstretched_count() == 0);
}

TEST_CASE("where the target is a small part of the source there are no slivers") {
  const Mesh source = test::rough_sphere(4, 0.04);
  std::vector<char> keep;
  Pairs pairs;
  for (int j = 0; j < source.triangle_count(); ++j) {
    keep.push_back(triangle_centre(source.positions, source.triangles, j)[0] > 0.85);
    if (keep.back()) pairs.push_back({j, int(pairs.size())});
  }
  const Mesh target = test::kept(source, keep);
  REQUIRE(10 * target.triangle_count() < source.triangle_count());
  const auto correspondence =
      triangle_correspondence(pairs, source.triangle_count(), target.triangle_count());
  for (const double size : {1.0, 0.1, 30.0}) {
    const Mesh scaled = {size * target.positions, target.triangles};
    const MeshTransfer transfer(source, scaled, correspondence, {});
    CHECK(transfer.gradients().overstretched_count() == 0);
  }
}

TEST_CASE(
    "a part that is larger on the target as a whole has no slivers, one without area does no "
    "harm") {
  Mesh small = test::rough_sphere(4, 0.1);
  const Positions wide = small.positions.rowwise() + Eigen::RowVector3d(4, 0, 0);
  const auto with_part = [&](double size) {
    small.positions = (size * (wide.rowwise() - Eigen::RowVector3d(4, 0, 0))).rowwise() +
                      Eigen::RowVector3d(4, 0, 0);
    return test::appended(test::rough_sphere(4, 0.1), small);
  };
  const Mesh target = with_part(1);
  const int m = target.triangle_count();
  Pairs pairs;  // one more than triangles, so that they aren't one to one
  for (int j = 0; j < m; ++j) pairs.push_back({j, j});
  pairs.push_back({1, 0});
  const auto correspondence = triangle_correspondence(pairs, m, m);
  for (const double size : {0.01, 0.0}) {
    const Mesh source = with_part(size);
    TransferOptions options;
    options.placing = Placing::vertices;
    MeshTransfer transfer(source, target, correspondence, options);
    CHECK(transfer.gradients().overstretched_count() == 0);
    CHECK(transfer.gradients().overstretched_example() == -1);
    // The other part goes where the source's goes.
    const Index n = target.vertex_count() / 2;
    const Positions pose = arched(source.positions), there = transfer.apply(pose, false);
    CHECK(largest_difference(there.topRows(n), pose.topRows(n)) < 0.05);
    // The part itself has the gradient of the small one, the Jacobian of arched() at (4, 0, 0). A
    // point has none, so there the part keeps its shape.
    Eigen::Matrix3d jacobian = Eigen::Matrix3d::Identity();
    if (size > 0) jacobian.col(2) << 0, 0.3 * 2, 0.9 * 6;
    const Positions expected = (target.positions.bottomRows(n).rowwise() -
                                target.positions.bottomRows(n).colwise().mean()) *
                               jacobian.transpose();
    const Positions part = there.bottomRows(n).rowwise() - there.bottomRows(n).colwise().mean();
    INFO("size " << size);
    CHECK(largest_difference(part, expected) < (size > 0 ? 0.2 : 1e-9));
    // And the other way round: a part of the target that has no area stays small beside that of
    // the source.
    MeshTransfer back(target, source, correspondence, options);
    const Positions other = back.apply(arched(target.positions), false);
    CHECK(largest_difference(other.topRows(n), arched(target.positions).topRows(n)) < 0.05);
    const double box = bounding_box_diagonal(other.bottomRows(n));
    CHECK(box < 0.15 * bounding_box_diagonal(arched(target.positions).bottomRows(n)));
  }
}

namespace {

/// A finer mesh on the surface of another: its vertices, the middles of its edges and of its
/// triangles.
Mesh finer(const Mesh& mesh) {
  const Edges edges(mesh.triangles);
  const std::vector<int> edge_of = edges.of_half_edges();
  const int n = mesh.vertex_count(), middles = n + edges.count();
  Mesh result;
  result.positions.resize(middles + mesh.triangle_count(), 3);
  result.positions.topRows(n) = mesh.positions;
  result.triangles.resize(6 * mesh.triangle_count(), 3);
  for (int j = 0; j < mesh.triangle_count(); ++j) {
    const auto corner = [&](int k) { return mesh.triangles(j, k % 3); };
    result.positions.row(middles + j) =
        triangle_centre(mesh.positions, mesh.triangles, j).transpose();
    for (int k = 0; k < 3; ++k) {
      const int middle = n + edge_of[size_t(3 * j + k)];
      result.positions.row(middle) =
          0.5 * (mesh.positions.row(corner(k)) + mesh.positions.row(corner(k + 1)));
      result.triangles.row(6 * j + 2 * k) << corner(k), middle, middles + j;
      result.triangles.row(6 * j + 2 * k + 1) << middle, corner(k + 1), middles + j;
    }
  }
  return result;
}

/// Values at a mesh's vertices, interpolated at points of its triangles.
Positions at_points(const std::vector<PointOnTriangle>& points, const Triangles& t,
                    const Positions& values) {
  Positions result = Positions::Zero(Index(points.size()), 3);
  for (size_t v = 0; v < points.size(); ++v)
    for (int k = 0; k < 3; ++k)
      result.row(Index(v)) += points[v].barycentric[k] * values.row(t(points[v].triangle, k));
  return result;
}

}  // namespace

TEST_CASE("a source that was fitted tells the points that a target's vertices correspond to") {
  const Mesh source = test::rough_sphere(3, 0.15), target = finer(source);
  ThreadPool pool(2);
  const Match match = match_triangles(source, target, 0.1);
  const auto points = points_of_fit(source, target, match.correspondence, pool);
  CHECK(largest_difference(at_points(points, source.triangles, source.positions),
                           target.positions) < 1e-12);
  // Pairs of triangles alone don't tell the vertices' points as exactly.
  const SourceGradients gradients(source, target, match.correspondence, {});
  const Similarity placement;
  TransferContext context;
  context.source = &source;
  context.target = &target;
  context.placement = &placement;
  context.gradients = &gradients;
  context.pool = &pool;
  const SourcePoints told(context, VertexTriangles(target.triangles, target.vertex_count()));
  double off = 0;
  for (int v = 0; v < target.vertex_count(); ++v)
    off =
        std::max(off, (told.at(source.positions, v) - target.positions.row(v).transpose()).norm());
  CHECK(off > 1e-3);
}

TEST_CASE("displacements are the source's, in proportion where sizes differ") {
  const Mesh source = test::rough_sphere(3, 0.15);
  const Positions pose = arched(source.positions), moves = pose - source.positions;
  Mesh shape = finer(source);
  ThreadPool pool(1);
  const Match match = match_triangles(source, shape, 0.1);
  TransferOptions options;
  options.points = points_of_fit(source, shape, match.correspondence, pool);
  options.placing = Placing::displacements;
  const Positions expected = at_points(options.points, source.triangles, moves);
  // Another shape, turned and of another size.
  shape.positions.col(1) *= 1.3;
  const Eigen::Matrix3d turn = rotation_by(Eigen::Vector3d(0.4, -1, 2));
  const double halfway = 1.15;  // between sizes that count as the same and those that scale fully
  for (const auto& [size, share] : {std::pair(1.0, 1.0),
                                    {1.09, 1.0},
                                    {0.92, 1.0},
                                    {3.0, 3.0},
                                    {0.01, 0.01},
                                    {halfway, std::sqrt(halfway)}}) {
    INFO("size " << size);
    Similarity placement;
    placement.rotation = turn;
    placement.scale = size;
    options.placement = &placement;
    const Mesh target = {size * shape.positions * turn.transpose(), shape.triangles};
    MeshTransfer transfer(source, target, match.correspondence, options);
    CHECK(largest_difference(transfer.apply(pose, false),
                             target.positions + share * expected * turn.transpose()) < 1e-9 * size);
    CHECK(largest_difference(transfer.apply(source.positions, false), target.positions) < 1e-12);
  }
  // Without points of their own, vertices take those of the pairs.
  options.points.clear();
  options.placement = nullptr;
  MeshTransfer by_pairs(source, shape, match.correspondence, options);
  const double error = largest_difference(by_pairs.apply(pose, false), shape.positions + expected);
  CHECK(error > 1e-6);
  CHECK(error < 0.3 * moves.rowwise().norm().maxCoeff());
}

TEST_CASE("vertices without a point go with displaced ones around them") {
  const Mesh source = test::rough_sphere(4, 0.15);
  const Positions& p = source.positions;
  Pairs pairs;
  std::vector<char> known(size_t(source.vertex_count()), 0);
  for (int j = 0; j < source.triangle_count(); ++j) {
    if (triangle_centre(p, source.triangles, j).z() > 0.7) continue;
    pairs.push_back({j, j});
    for (int k = 0; k < 3; ++k) known[size_t(source.triangles(j, k))] = 1;
  }
  REQUIRE(std::count(known.begin(), known.end(), 0) > 20);
  const int m = source.triangle_count();
  TransferOptions options;
  options.placing = Placing::displacements;
  MeshTransfer transfer(source, source, triangle_correspondence(pairs, m, m), options);
  const Eigen::RowVector3d shift(0.3, -1, 2);
  const Positions shifted = p.rowwise() + shift;
  CHECK(largest_difference(transfer.apply(shifted, false), shifted) < 1e-9);
  // The motion around the hole is continued into it, without a crease at its rim.
  Positions wave = p;
  for (Index v = 0; v < p.rows(); ++v) wave(v, 0) += 0.2 * p(v, 2);
  const Positions found = transfer.apply(wave, false);
  for (int v = 0; v < source.vertex_count(); ++v)
    CHECK((found.row(v) - wave.row(v)).norm() < (known[size_t(v)] ? 1e-3 : 0.1));
}

TEST_CASE("parts without a source go as displaced ones do, and pinned ones keep theirs") {
  Mesh small = test::rough_sphere(3, 0.1);
  small.positions = (0.4 * small.positions).rowwise() + Eigen::RowVector3d(1.6, 0, 0);
  const Mesh source = test::appended(test::rough_sphere(3, 0.2), small);
  const Mesh target = {1.09 * source.positions, source.triangles};
  const int m = source.triangle_count(), of_large = m - small.triangle_count();
  const Eigen::RowVector3d shift(0, 3, 1);
  const Positions pose = source.positions.rowwise() + shift;
  TransferOptions options;
  options.placing = Placing::displacements;
  Pairs pairs;
  for (int j = 0; j < of_large; ++j) pairs.push_back({j, j});
  MeshTransfer alone(source, target, triangle_correspondence(pairs, m, m), options);
  REQUIRE(alone.unmatched_component_count() == 1);
  CHECK(largest_difference(alone.apply(pose, false), target.positions.rowwise() + shift) < 1e-9);
  options.anchor = Anchor::pinned;
  options.anchors = {5, 11, 40};
  MeshTransfer pinned(source, target, identity_correspondence(source, target), options);
  CHECK(largest_difference(pinned.apply(pose, false), target.positions) < 1e-9);
}

TEST_CASE("vertices without a given point take the pairs', and weights are scaled to add up to 1") {
  const Mesh source = test::rough_sphere(3, 0.15), target = finer(source);
  ThreadPool pool(1);
  const Match match = match_triangles(source, target, 0.1);
  const auto all = points_of_fit(source, target, match.correspondence, pool);
  const Positions pose = arched(source.positions);
  for (const Placing placing : {Placing::vertices, Placing::parts, Placing::displacements}) {
    TransferOptions options;
    options.placing = placing;
    const auto applied = [&](const std::vector<PointOnTriangle>& points) {
      options.points = points;
      return Positions(
          MeshTransfer(source, target, match.correspondence, options).apply(pose, false));
    };
    std::vector<PointOnTriangle> none(all.size()), short_of_one = all;
    for (PointOnTriangle& point : short_of_one) point.barycentric *= 0.9995;
    CHECK(largest_difference(applied(none), applied({})) == 0);
    CHECK(largest_difference(applied(short_of_one), applied(all)) < 1e-12);
  }
}

TEST_CASE("points with an impossible triangle, weights or count are refused") {
  const Mesh mesh = test::rough_sphere(2, 0.1);
  const auto refused = [&](int triangle, const Eigen::Vector3d& weights, Index count) {
    TransferOptions options;
    options.points.resize(size_t(count));
    for (PointOnTriangle& point : options.points) {
      point.triangle = triangle;
      point.barycentric = weights;
    }
    MeshTransfer(mesh, mesh, identity_correspondence(mesh, mesh), options);
  };
  const Index n = mesh.positions.rows();
  const Eigen::Vector3d middle = Eigen::Vector3d::Constant(1 / 3.0);
  CHECK_NOTHROW(refused(3, middle, n));
  CHECK_NOTHROW(refused(-1, Eigen::Vector3d::Zero(), n));
  CHECK_THROWS_WITH(refused(3, middle, n - 1), contains("There are points of"));
  CHECK_THROWS_WITH(refused(mesh.triangle_count(), middle, n),
                    contains("Vertex 0 of the target has its point in"));
  CHECK_THROWS_WITH(refused(-2, middle, n), contains("triangle -2"));
  for (const Eigen::Vector3d& weights :
       {Eigen::Vector3d(1, 1, 0), Eigen::Vector3d(2, -1, 0),
        Eigen::Vector3d(std::numeric_limits<double>::quiet_NaN(), 0, 1)})
    CHECK_THROWS_WITH(refused(3, weights, n), contains("don't add up to 1"));
}

TEST_CASE("pins and anchors hold with places of the source, too") {
  Mesh small = test::rough_sphere(3, 0.1);
  small.positions = (0.4 * small.positions).rowwise() + Eigen::RowVector3d(1.6, 0, 0);
  const Mesh source = test::appended(test::rough_sphere(3, 0.2), small);
  Mesh target = source;
  target.positions.col(1) *= 1.1;
  const Positions pose = arched(source.positions);
  TransferOptions options;
  options.anchors = {5, 11};
  const auto [placing, anchor] =
      GENERATE(table<Placing, Anchor>({{Placing::vertices, Anchor::vertices},
                                       {Placing::vertices, Anchor::pinned},
                                       {Placing::vertices, Anchor::centroid},
                                       {Placing::displacements, Anchor::vertices},
                                       {Placing::displacements, Anchor::pinned},
                                       {Placing::displacements, Anchor::centroid}}));
  options.placing = placing;
  options.anchor = anchor;
  MeshTransfer transfer(source, target, identity_correspondence(source, target), options);
  const Positions found = transfer.apply(pose, false);
  REQUIRE(found.allFinite());
  const Eigen::RowVector3d mean = 0.5 * (found.row(5) + found.row(11)),
                           was = 0.5 * (target.positions.row(5) + target.positions.row(11));
  if (anchor != Anchor::centroid) CHECK((mean - was).norm() < 1e-9);
  if (anchor == Anchor::pinned) CHECK((found.row(5) - target.positions.row(5)).norm() < 1e-12);
}

TEST_CASE("the number of threads changes no bit of places and contacts", "[threads]") {
  const Lids source(0.04), target(0.05);
  TransferOptions options;
  options.placing = Placing::vertices;
  const auto result = [&](int threads) {
    options.threads = threads;
    MeshTransfer transfer(source.mesh, target.mesh,
                          identity_correspondence(source.mesh, target.mesh), options);
    return Positions(transfer.apply(Lids::closed(source.mesh.positions, 0.039), false));
  };
  CHECK(result(1) == result(3));
}
