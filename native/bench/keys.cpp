// SPDX-License-Identifier: GPL-3.0-or-later
// Transfers one head's shape keys to another topology on which the truth is known: the target is
// IDENTITY, a mesh of the same topology as REST, cut anew with three times the triangles, and a
// key's displacements of REST are the truth for it. Pairs are found by markers, vertices far from
// one another. Prints the mean error, in percent of the box, by gradients alone, with the places of
// the source, by displacements, and by the displacement of the nearest point of the fitted source.
// For keys that close a gap (an eye, a mouth) also the gap that they leave, over that of the truth.
// All this is of the largest loose part alone.
//
//   keys [--markers 11] [--turned 0] [--whole] REST.obj IDENTITY.obj KEY.obj...
//   turned: degrees by which the data of IDENTITY are turned about (1, 2, 3)
//   whole: with all loose parts, such as eyes and teeth; prints how many vertices have their point
//   on another part than their own. Markers and gaps are still of the largest part.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <numeric>
#include <string>
#include <vector>

#include "deform/mesh_transfer.h"
#include "match/points_of_fit.h"
#include "match/registration.h"
#include "match/triangle_match.h"
#include "mesh/aabb_tree.h"
#include "mesh/point_grid.h"
#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "mesh_files.h"
#include "support/rotations.h"

namespace {

using dd::Index;
using dd::Mesh;
using dd::Positions;

std::vector<int> all_of(const Mesh& mesh) {
  std::vector<int> all(size_t(mesh.vertex_count()));
  std::iota(all.begin(), all.end(), 0);
  return all;
}

/// Vertices of the largest loose part.
std::vector<int> largest_part(const Mesh& mesh) {
  const dd::Components parts(mesh.triangles, mesh.vertex_count());
  std::vector<int> sizes(size_t(parts.count), 0), result;
  for (int part : parts.of_vertex) ++sizes[size_t(part)];
  const auto largest = std::max_element(sizes.begin(), sizes.end()) - sizes.begin();
  for (int v = 0; v < mesh.vertex_count(); ++v)
    if (parts.of_vertex[size_t(v)] == largest) result.push_back(v);
  return result;
}

Mesh part_of(const Mesh& mesh, const std::vector<int>& vertices) {
  std::vector<int> number(size_t(mesh.vertex_count()), -1);
  Mesh part;
  part.positions.resize(Index(vertices.size()), 3);
  for (size_t i = 0; i < vertices.size(); ++i) {
    number[size_t(vertices[i])] = int(i);
    part.positions.row(Index(i)) = mesh.positions.row(vertices[i]);
  }
  std::vector<int> corners;
  for (int j = 0; j < mesh.triangle_count(); ++j)
    if (number[size_t(mesh.triangles(j, 0))] >= 0)
      for (int k = 0; k < 3; ++k) corners.push_back(number[size_t(mesh.triangles(j, k))]);
  part.triangles = Eigen::Map<dd::Triangles>(corners.data(), Index(corners.size() / 3), 3);
  return part;
}

/// The vertices of a mesh cut anew: those given, and the triangles' centres.
Positions cut_anew(const Positions& p, const dd::Triangles& t) {
  Positions result(p.rows() + t.rows(), 3);
  result.topRows(p.rows()) = p;
  for (int j = 0; j < t.rows(); ++j)
    result.row(p.rows() + j) = dd::triangle_centre(p, t, j).transpose();
  return result;
}

/// The triangles of a mesh cut anew: each edge between two triangles is replaced by that between
/// their centres.
dd::Triangles cut_anew(const dd::Triangles& t, int vertex_count) {
  std::vector<int> corners;
  const dd::Edges edges(t);
  for (int edge = 0; edge < edges.count(); ++edge) {
    const dd::Edges::Range sides = edges.of(edge);
    const auto side = [&](int i) { return *(sides.begin() + i); };
    const auto corner = [&](int i, int k) {
      return t(side(i).triangle(), (side(i).number % 3 + k) % 3);
    };
    const int centre = vertex_count + side(0).triangle();
    if (sides.size() == 2 && corner(0, 0) == corner(1, 1)) {
      const int other = vertex_count + side(1).triangle();
      corners.insert(corners.end(), {corner(0, 0), other, centre, corner(0, 1), centre, other});
    } else {
      for (int i = 0; i < sides.size(); ++i)
        corners.insert(corners.end(),
                       {corner(i, 0), corner(i, 1), vertex_count + side(i).triangle()});
    }
  }
  return Eigen::Map<dd::Triangles>(corners.data(), Index(corners.size() / 3), 3);
}

/// A vertex of `mesh` in the same loose part as vertex v of the mesh cut anew.
int own_vertex(const Mesh& mesh, int v) {
  return v < mesh.vertex_count() ? v : mesh.triangles(v - mesh.vertex_count(), 0);
}

/// `count` of the vertices `of`, each as far as possible from those before it.
std::vector<int> far_vertices(const Positions& positions, const std::vector<int>& of, int count) {
  Positions p(Index(of.size()), 3);
  for (size_t i = 0; i < of.size(); ++i) p.row(Index(i)) = positions.row(of[i]);
  std::vector<int> result;
  Eigen::VectorXd distances = (p.rowwise() - p.colwise().mean()).rowwise().norm();
  for (int i = 0; i < count; ++i) {
    Index farthest;
    distances.maxCoeff(&farthest);
    if (i == 0) distances.setConstant(1e300);
    result.push_back(of[size_t(farthest)]);
    distances = distances.cwiseMin((p.rowwise() - p.row(farthest)).rowwise().norm());
  }
  return result;
}

/// Pairs of these vertices that a pose brings next to one another, to a third of their distance.
dd::Pairs closing(const Positions& rest, const Positions& posed, const std::vector<int>& of) {
  const double box = dd::bounding_box_diagonal(rest);
  dd::ThreadPool pool;
  const dd::PointGrid grid(posed, of, 0.003 * box, pool);
  std::vector<int> nearest(size_t(rest.rows()), -1);
  std::vector<double> least(nearest.size(), 1e300);
  const auto offer = [&](int i, int j, double squared) {
    if (!(squared < least[size_t(i)])) return;
    least[size_t(i)] = squared;
    nearest[size_t(i)] = j;
  };
  for (int k = 0; k < grid.count(); ++k)
    grid.near_after(k, 1000, [&](int l, double squared) {
      const int i = grid.point(k), j = grid.point(l);
      const double apart = (rest.row(i) - rest.row(j)).norm();
      if (!(apart > 0.008 * box && apart > 3 * std::sqrt(squared))) return;
      offer(i, j, squared);
      offer(j, i, squared);
    });
  dd::Pairs pairs;
  for (int i : of)
    if (nearest[size_t(i)] >= 0) pairs.push_back({i, nearest[size_t(i)]});
  return pairs;
}

double mean_gap(const Positions& p, const dd::Pairs& pairs) {
  double sum = 0;
  for (const auto& [i, j] : pairs) sum += (p.row(i) - p.row(j)).norm();
  return sum / double(pairs.size());
}

}  // namespace

int main(int argc, char** argv) try {
  int marker_count = 11;
  double turned = 0;
  bool with_all = false;
  std::vector<std::string> files;
  for (int i = 1; i < argc; ++i) {
    if (!std::strcmp(argv[i], "--markers") && i + 1 < argc)
      marker_count = std::atoi(argv[++i]);
    else if (!std::strcmp(argv[i], "--turned") && i + 1 < argc)
      turned = std::atof(argv[++i]);
    else if (!std::strcmp(argv[i], "--whole"))
      with_all = true;
    else
      files.push_back(argv[i]);
  }
  if (files.size() < 3) {
    std::fprintf(stderr,
                 "keys [--markers 11] [--turned 0] [--whole] REST.obj IDENTITY.obj KEY.obj...\n");
    return 2;
  }
  const Mesh whole = dd::bench::mesh_from_file(files[0]);
  const std::vector<int> part = with_all ? all_of(whole) : largest_part(whole);
  const Mesh source = part_of(whole, part);
  const auto read = [&](const std::string& file) {
    const Mesh mesh = dd::bench::mesh_from_file(file);
    if (mesh.vertex_count() != whole.vertex_count())
      throw std::runtime_error(file + " has another number of vertices than " + files[0]);
    return part_of(mesh, part).positions;
  };
  const Eigen::Matrix3d turn =
      dd::rotation_by(turned * dd::kPi / 180 * Eigen::Vector3d(1, 2, 3).normalized());
  const Positions identity = read(files[1]) * turn.transpose();
  const Mesh target = {cut_anew(identity, source.triangles),
                       cut_anew(source.triangles, source.vertex_count())};
  const double box = dd::bounding_box_diagonal(target.positions);
  const dd::Components parts(source.triangles, source.vertex_count());
  const std::vector<int> skin = largest_part(target);

  dd::Pairs markers;
  for (int v : far_vertices(source.positions, largest_part(source), marker_count))
    markers.push_back({v, v});
  const Mesh fitted = {dd::register_onto(source, target, markers, {}), source.triangles};
  const dd::Match match = dd::match_triangles(fitted, target, 0.1);
  dd::TransferOptions options;
  dd::MeshTransfer gradients(source, target, match.correspondence, options);
  dd::ThreadPool pool(0);
  options.points = dd::points_of_fit(fitted, target, match.correspondence, pool);
  int elsewhere = 0;
  for (int v = 0; v < target.vertex_count(); ++v) {
    const int there = options.points[size_t(v)].triangle;
    if (there >= 0 && parts.of_vertex[size_t(source.triangles(there, 0))] !=
                          parts.of_vertex[size_t(own_vertex(source, v))])
      ++elsewhere;
  }
  options.placing = dd::Placing::vertices;
  dd::MeshTransfer places(source, target, match.correspondence, options);
  options.placing = dd::Placing::displacements;
  dd::MeshTransfer displacements(source, target, match.correspondence, options);
  const dd::AabbTree tree(fitted);

  constexpr int kWays = 4;
  double sums[kWays] = {}, largest[kWays] = {}, largest_move = 0;
  std::string what_moves;
  const size_t count = files.size() - 2;
  std::printf("%d and %d triangles, %d markers\n", source.triangle_count(), target.triangle_count(),
              int(markers.size()));
  if (with_all)
    std::printf("%d of %d vertices have their point on another loose part than their own\n",
                elsewhere, target.vertex_count());
  for (size_t i = 2; i < files.size(); ++i) {
    const Positions pose = read(files[i]), moves = pose - source.positions;
    const Positions truth = target.positions + cut_anew(moves, source.triangles) * turn.transpose();
    Positions nearest = target.positions;
    for (Index v = 0; v < nearest.rows(); ++v) {
      const dd::PointOnTriangle point =
          tree.nearest(target.positions.row(v).transpose(), box, [](int) { return true; });
      for (int k = 0; k < 3; ++k)
        nearest.row(v) += point.barycentric[k] * moves.row(source.triangles(point.triangle, k)) *
                          turn.transpose();
    }
    const Positions found[kWays] = {gradients.apply(pose, false), places.apply(pose, false),
                                    displacements.apply(pose, false), nearest};
    for (int way = 0; way < kWays; ++way) {
      const Eigen::VectorXd error = (found[way] - truth).rowwise().norm() * (100 / box);
      sums[way] += error.mean();
      largest[way] = std::max(largest[way], error.maxCoeff());
    }
    const double move = (found[1] - target.positions).rowwise().norm().maxCoeff() /
                        std::max(1e-4 * box, moves.rowwise().norm().maxCoeff());
    if (move > largest_move) largest_move = move, what_moves = files[i];
    const dd::Pairs pairs = closing(target.positions, truth, skin);
    const size_t name = files[i].find_last_of('/') + 1;
    if (pairs.size() > 50) {
      const double of_truth = mean_gap(truth, pairs);
      std::printf("%-24s gap, in parts of the truth's:", files[i].c_str() + name);
      for (const Positions& each : found) std::printf(" %.2f", mean_gap(each, pairs) / of_truth);
      std::printf("\n");
    }
  }
  std::printf("%zu keys: by gradients, with places, by displacements, by the nearest point\n",
              count);
  std::printf("mean error, %% of the box:");
  for (double sum : sums) std::printf(" %.4f", sum / double(count));
  std::printf("\nlargest:");
  for (double each : largest) std::printf(" %.2f", each);
  std::printf("\n");
  std::printf("no vertex moves farther than %.2f times what the source's do (%s)\n", largest_move,
              what_moves.c_str());
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
