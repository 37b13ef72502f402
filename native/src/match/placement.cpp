// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/placement.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "match/near_pull.h"
#include "mesh/topology.h"

namespace dd {

namespace {

/// Iterations and samples of the iterated closest points. by_near: distances have the robust weight
/// of near_pull(), else all have the same.
struct Effort {
  int rounds;
  size_t samples;
  bool by_near = false;
};
constexpr Effort kQuick = {4, 60}, kWhole = {12, 300}, kNear = {40, 300, true},
                 kMeasured = {0, 300};

// Lengths are fractions of the diagonal of the target's box unless stated otherwise.
constexpr double kNearby = 3;       // times the median distance: where the robust weight is 1/4
constexpr double kNearest = 0.001;  // least median: keeps the weights of exact fits defined
// The largest median distance at which one surface is said to lie on the other. Tuned: heads of one
// family have .004, animals of different species .01.
constexpr double kLying = 0.006;
// A part lies on a whole if this fraction of its samples is near, where near is at most kLying and
// at most kOfPart of the part's own box, as all of a tiny part is within kLying of a surface by
// chance.
constexpr double kMost = 0.9, kOfPart = 0.1;
constexpr double kSettled = 0.002;    // relative change of the misfit below which rounds stop
constexpr size_t kPromising = 8;      // placements kept after the quick look; more take longer
constexpr int kManyMarkers = 8;       // this many determine a similarity without closest points
constexpr double kMarkerShare = 0.1;  // weight of a marker; all samples together have 1
constexpr double kAlike = 0.03;       // placements with a smaller mean distance count as one
constexpr double kAnywhere = std::numeric_limits<double>::infinity();
constexpr double kWorthTrying = 1.5;  // largest ratio of a candidate's misfit to the least one

Positions mirror(Positions points, bool whether) {
  if (whether) points.col(0) *= -1;
  return points;
}

bool on_a_line(const Positions& points) {
  const Positions arms = points.rowwise() - points.colwise().mean();
  // Squared singular values, ascending. Not by Eigen's SVD of a matrix of dynamic size, which frees
  // twice if an allocation fails.
  const Eigen::Matrix3d moments = arms.transpose() * arms;
  const Eigen::Vector3d spread =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments, Eigen::EigenvaluesOnly).eigenvalues();
  return !(spread[1] > 1e-6 * spread[2]);
}

/// Centre and second moments of a surface.
struct Moments {
  explicit Moments(const CoarseShape& shape) {
    const Mesh& mesh = shape.mesh;
    Eigen::VectorXd shares = Eigen::VectorXd::Zero(mesh.vertex_count());
    for (int j = 0; j < mesh.triangle_count(); ++j)
      for (int v : mesh.triangles.row(j)) shares[v] += shape.areas[j];
    shares /= shares.sum();
    centre = shares.transpose() * mesh.positions;
    const Positions arms = mesh.positions.rowwise() - centre;
    const Eigen::Matrix3d second = arms.transpose() * shares.asDiagonal() * arms;
    size = std::sqrt(second.trace());
    axes = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(second).eigenvectors();
    if (axes.determinant() < 0) axes.col(0) *= -1;
  }
  Eigen::RowVector3d centre;
  double size;
  Eigen::Matrix3d axes;
};

/// The closest point with a normal less than 90° off; if there is none, the closest of all.
Eigen::Vector3d nearest_of(const CoarseShape& shape, const Eigen::Vector3d& point,
                           const Eigen::Vector3d& normal) {
  const PointOnTriangle facing = shape.tree.nearest_facing(point, normal, kAnywhere);
  if (facing.triangle >= 0) return facing.place;
  return shape.tree.nearest(point, kAnywhere, [](int) { return true; }).place;
}

/// The larger of two median row lengths: of the first n rows, and of the next m.
double larger_median(const Positions& rows, Index n, Index m) {
  const Eigen::VectorXd lengths = rows.topRows(n + m).rowwise().norm();
  const auto median_of = [&](Index first, Index count) {
    return median({lengths.data() + first, lengths.data() + first + count});
  };
  return std::max(median_of(0, n), median_of(n, m));
}

/// Whether each marker comes to within kElsewhere / 2 of its partner.
bool keeps(const Similarity& placement, const MarkedPlaces& marked) {
  const Positions astray = placement.all(marked.source) - marked.target;
  return !(astray.rowwise().norm().array() > kElsewhere / 2).any();
}

bool is_open(const CoarseShape& shape) {
  const Borders borders(shape.mesh.triangles, shape.mesh.vertex_count());
  return std::find(borders.half_edges.begin(), borders.half_edges.end(), 1) !=
         borders.half_edges.end();
}

/// Whether most samples of a placed surface are nearer than far to another one, in the latter's
/// box.
bool most_are_near(const CoarseShape& shape, const Similarity& placement, const CoarseShape& other,
                   double far) {
  const size_t count = std::min(kMeasured.samples, shape.samples.size());
  size_t near = 0;
  for (size_t i = 0; i < count; ++i) {
    const int v = shape.samples[i];
    const Eigen::Vector3d point = placement(shape.mesh.positions.row(v).transpose());
    const Eigen::Vector3d normal = placement.rotation * shape.normals.row(v).transpose();
    near += (nearest_of(other, point, normal) - point).norm() < far;
  }
  return static_cast<double>(near) > kMost * static_cast<double>(count);
}

/// Iterated closest points, in both directions. Sets the similarity and the misfit; by_near, that
/// is the larger of both directions' median distances.
void settle(Placement& start, const CoarseShape& source, const CoarseShape& target,
            const MarkedPlaces& marked, const Effort& effort) {
  const Positions from =
      mirror(rows_of(source.mesh.positions, source.samples, effort.samples), start.mirrored);
  const Positions marked_source = mirror(marked.source, start.mirrored);
  const Positions onto = rows_of(target.mesh.positions, target.samples, effort.samples);
  const Index n = from.rows(), m = onto.rows(), k = marked.source.rows();
  Positions pairs_from(n + m + k, 3), pairs_onto(n + m + k, 3);
  Eigen::VectorXd weights(n + m + k);
  weights << Eigen::VectorXd::Constant(n + m, 1.0 / double(n + m)),
      Eigen::VectorXd::Constant(k, kMarkerShare);
  pairs_from.bottomRows(k) = marked_source;
  pairs_onto.bottomRows(k) = marked.target;
  const double first_scale = start.similarity.scale;
  for (int round = 0; round <= effort.rounds; ++round) {
    const double before = start.misfit;
    const Similarity back = start.similarity.inverse();
    for (Index i = 0; i < n; ++i) {
      pairs_from.row(i) = from.row(i);
      const Eigen::Vector3d normal =
          start.similarity.rotation *
          mirror(source.normals.row(source.samples[size_t(i)]), start.mirrored).transpose();
      const Eigen::Vector3d point = start.similarity(from.row(i).transpose());
      pairs_onto.row(i) = nearest_of(target, point, normal).transpose();
    }
    for (Index i = 0; i < m; ++i) {
      pairs_onto.row(n + i) = onto.row(i);
      Eigen::Vector3d normal =
          back.rotation * target.normals.row(target.samples[size_t(i)]).transpose();
      Eigen::Vector3d point = back(onto.row(i).transpose());
      if (start.mirrored) normal[0] *= -1, point[0] *= -1;
      pairs_from.row(n + i) = mirror(nearest_of(source, point, normal).transpose(), start.mirrored);
    }
    const Positions misfits = start.similarity.all(pairs_from) - pairs_onto;
    if (effort.by_near) {
      start.misfit = larger_median(misfits, n, m);
      const double near = kNearby * std::max(kNearest, start.misfit);
      for (Index i = 0; i < n + m; ++i)
        weights[i] = near_pull(misfits.row(i).norm() / near) / double(n + m);
    } else {
      start.misfit = std::sqrt(misfits.topRows(n).rowwise().squaredNorm().mean()) +
                     std::sqrt(misfits.middleRows(n, m).rowwise().squaredNorm().mean());
      if (k > 0) start.misfit += std::sqrt(misfits.bottomRows(k).rowwise().squaredNorm().mean());
    }
    if (round == effort.rounds) break;
    // A median may stay while the rest still moves.
    if (round > 0 && !effort.by_near && std::abs(before - start.misfit) < kSettled * before) break;
    const Similarity next = fitted_similarity(pairs_from, pairs_onto, weights);
    // Shapes with little in common: the source would shrink to a point of the target, or vice
    // versa.
    if (!(next.scale > 0.5 * first_scale && next.scale < 2 * first_scale)) break;
    start.similarity = next;
  }
}

/// The first start and, of the others, up to `most` that differ, by ascending misfit.
std::vector<Placement> best_of(std::vector<Placement> starts, const CoarseShape& source,
                               size_t most) {
  std::stable_sort(starts.begin() + 1, starts.end(),
                   [](const Placement& a, const Placement& b) { return a.misfit < b.misfit; });
  std::vector<Placement> kept;
  std::vector<Positions> places;
  for (Placement& start : starts) {
    Positions here = start.samples(source, kQuick.samples);
    const bool known = std::any_of(places.begin(), places.end(), [&](const Positions& other) {
      return (other - here).rowwise().norm().mean() < kAlike;
    });
    if (known) continue;
    kept.push_back(start);
    places.push_back(std::move(here));
    if (kept.size() > most) break;
  }
  return kept;
}

}  // namespace

double Placement::preferred() const {
  return (misfit + kExact) * (as_they_stand ? kAsTheyStand : 1);
}

bool Placement::fits_about_as(const Placement& best) const {
  return misfit + kExact < kNearlyAsWell * (best.misfit + kExact);
}

Positions Placement::samples(const CoarseShape& source, size_t count) const {
  return similarity.all(mirror(rows_of(source.mesh.positions, source.samples, count), mirrored));
}

bool MarkedPlaces::suffice() const {
  return source.rows() >= 3 && !on_a_line(source) && !on_a_line(target);
}

Placement placement_by(const MarkedPlaces& marked, const CoarseShape& source,
                       const CoarseShape& target) {
  Placement found;
  found.similarity =
      fitted_similarity(marked.source, marked.target, Eigen::VectorXd::Ones(marked.source.rows()));
  // A few markers don't determine the scale reliably.
  if (marked.source.rows() < kManyMarkers) settle(found, source, target, marked, kWhole);
  return found;
}

std::vector<Placement> placements(const CoarseShape& source, const CoarseShape& target,
                                  const MarkedPlaces& marked, ThreadPool& pool) {
  const Moments from(source), onto(target);
  std::vector<Eigen::Matrix3d> rotations = rotations_of_axes();
  for (int k = 0; k < 4; ++k) {  // no turn, or half a turn about a principal axis
    Eigen::Vector3d signs = Eigen::Vector3d::Constant(k == 0 ? 1 : -1);
    if (k > 0) signs[k - 1] = 1;
    rotations.push_back(onto.axes * signs.asDiagonal() * from.axes.transpose());
  }
  const size_t count = rotations.size();
  std::vector<Placement> all(2 * count);
  pool.run(static_cast<int>(all.size()), [&](int i) {
    Placement& one = all[size_t(i)];
    one.as_they_stand = i == 0;
    one.mirrored = size_t(i) >= count;
    one.similarity.rotation = rotations[size_t(i) % count];
    one.similarity.scale = onto.size / from.size;
    one.similarity.shift = onto.centre.transpose() -
                           one.similarity.scale * (one.similarity.rotation *
                                                   mirror(from.centre, one.mirrored).transpose());
    settle(one, source, target, marked, kQuick);
  });
  all = best_of(std::move(all), source, kPromising);
  pool.run(static_cast<int>(all.size()),
           [&](int i) { settle(all[size_t(i)], source, target, marked, kWhole); });
  all = best_of(std::move(all), source, kPromising);
  double least = all.front().misfit;
  for (const Placement& one : all) least = std::min(least, one.misfit);
  all.erase(std::remove_if(all.begin() + 1, all.end(),
                           [&](const Placement& one) {
                             return one.misfit + kExact > kWorthTrying * (least + kExact);
                           }),
            all.end());
  return all;
}

void measure_by_shape(Placement& placement, const CoarseShape& source, const CoarseShape& target) {
  settle(placement, source, target, {}, kMeasured);
}

std::optional<Lying> lying_on(const std::vector<Placement>& starts, const CoarseShape& source,
                              const CoarseShape& target, const MarkedPlaces& marked,
                              ThreadPool& pool) {
  std::vector<Placement> settled = starts;
  pool.run(static_cast<int>(starts.size()), [&](int i) {
    Placement& one = settled[size_t(i)];
    if (!one.mirrored) settle(one, source, target, marked, kNear);
  });
  // The misfits of the starts decide, as those by robust weights don't tell details apart.
  std::vector<size_t> lying;
  for (size_t i = 0; i < settled.size(); ++i) {
    if (!settled[i].mirrored && settled[i].misfit < kLying && keeps(settled[i].similarity, marked))
      lying.push_back(i);
  }
  if (lying.empty()) return std::nullopt;
  const size_t best = *std::min_element(lying.begin(), lying.end(), [&](size_t a, size_t b) {
    return starts[a].preferred() < starts[b].preferred();
  });
  const Positions places = settled[best].samples(source, kQuick.samples);
  const bool ambiguous = std::any_of(lying.begin(), lying.end(), [&](size_t i) {
    const Positions others = settled[i].samples(source, kQuick.samples);
    return starts[i].fits_about_as(starts[best]) &&
           (others - places).rowwise().norm().mean() > kElsewhere;
  });
  return Lying{settled[best].similarity, ambiguous};
}

bool stands_on(const CoarseShape& source, const CoarseShape& target, const MarkedPlaces& marked,
               const Similarity& stance) {
  if (!keeps(stance, marked)) return false;
  // kLying of the larger box, as small distances there are large ones in the smaller box.
  const double far = kLying * std::max(1.0, stance.scale);
  const double of_source = std::min(far, kOfPart * stance.scale),
               of_target = std::min(far, kOfPart);
  return (is_open(source) && most_are_near(source, stance, target, of_source)) ||
         (is_open(target) &&
          most_are_near(target, stance.inverse(), source, of_target / stance.scale));
}

}  // namespace dd
