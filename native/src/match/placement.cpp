// SPDX-License-Identifier: GPL-3.0-or-later
#include "match/placement.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "match/robust_statistics.h"
#include "mesh/topology.h"

namespace dd {

namespace {

/// Iterations and samples of the iterated closest points. robust: distances have the robust weight
/// of geman_mcclure_weight(), else all have the same.
struct ClosestPointsEffort {
  int rounds;
  size_t samples;
  bool robust = false;
};
constexpr ClosestPointsEffort kQuickEffort = {4, 60}, kWholeEffort = {12, 300},
                              kRobustEffort = {40, 300, true}, kMeasureOnly = {0, 300};

// Lengths are fractions of the diagonal of the target's box unless stated otherwise.
constexpr double kRobustMedians = 3;  // times the median distance: where the robust weight is 1/4
constexpr double kMinMedian = 0.001;  // keeps the weights of exact fits defined
// The largest median distance at which one surface is said to lie on the other. Tuned: heads of one
// family have .004, animals of different species .01.
constexpr double kMaxPartialFitMedian = 0.006;
// A part lies on a whole if this fraction of its samples is near: within kMaxPartialFitMedian, and
// within kMaxNearOfPart of the part's own box, as all of a tiny part is near any surface that
// passes by.
constexpr double kMinNearFraction = 0.9, kMaxNearOfPart = 0.1;
constexpr double kMaxConvergedMisfitChange = 0.002;  // relative, below which rounds stop
constexpr size_t kMaxPromising = 8;    // placements kept after the quick pass; more take longer
constexpr int kMarkersForScale = 8;    // as many determine a similarity without closest points
constexpr double kMarkerWeight = 0.1;  // of each marker; all samples together have 1
constexpr double kSamePlacementDistance = 0.03;  // mean distance below which two count as one
constexpr double kMaxMisfitRatio = 1.5;          // of a candidate worth trying to the best one
constexpr double kUnlimited = std::numeric_limits<double>::infinity();

Positions mirrored_if(Positions points, bool is_mirrored) {
  if (is_mirrored) points.col(0) *= -1;
  return points;
}

bool are_collinear(const Positions& points) {
  const Positions arms = points.rowwise() - points.colwise().mean();
  // Squared singular values, ascending. Not by Eigen's SVD of a matrix of dynamic size, which frees
  // twice if an allocation fails.
  const Eigen::Matrix3d moments = arms.transpose() * arms;
  const Eigen::Vector3d spread =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments, Eigen::EigenvaluesOnly).eigenvalues();
  // Safety: points within a thousandth of their extent of a line determine no rotation about it.
  return !(spread[1] > 1e-6 * spread[2]);
}

/// Centre and second moments of a surface.
struct Moments {
  explicit Moments(const CoarseShape& shape) {
    const Mesh& mesh = shape.mesh;
    Eigen::VectorXd vertex_weights = Eigen::VectorXd::Zero(mesh.vertex_count());
    for (int j = 0; j < mesh.triangle_count(); ++j)
      for (int v : mesh.triangles.row(j)) vertex_weights[v] += shape.areas[j];
    vertex_weights /= vertex_weights.sum();
    centre = vertex_weights.transpose() * mesh.positions;
    const Positions arms = mesh.positions.rowwise() - centre;
    const Eigen::Matrix3d second = arms.transpose() * vertex_weights.asDiagonal() * arms;
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
  const PointOnTriangle facing = shape.tree.nearest_facing(point, normal, kUnlimited);
  if (facing.triangle >= 0) return facing.position;
  return shape.tree.nearest(point, kUnlimited, [](int) { return true; }).position;
}

/// The larger of two median row lengths: of the first n rows, and of the next m.
double larger_median(const Positions& rows, Index n, Index m) {
  const Eigen::VectorXd lengths = rows.topRows(n + m).rowwise().norm();
  const auto median_of = [&](Index first, Index count) {
    return median({lengths.data() + first, lengths.data() + first + count});
  };
  return std::max(median_of(0, n), median_of(n, m));
}

/// Whether each marker comes to within kElsewhereDistance / 2 of its partner.
bool keeps_markers(const Similarity& placement, const MarkerPositions& marked) {
  const Positions marker_residuals = placement.all(marked.source) - marked.target;
  return !(marker_residuals.rowwise().norm().array() > kElsewhereDistance / 2).any();
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
  const size_t count = std::min(kMeasureOnly.samples, shape.samples.size());
  size_t near = 0;
  for (size_t i = 0; i < count; ++i) {
    const int v = shape.samples[i];
    const Eigen::Vector3d point = placement(shape.mesh.positions.row(v).transpose());
    const Eigen::Vector3d normal = placement.rotation * shape.normals.row(v).transpose();
    near += (nearest_of(other, point, normal) - point).norm() < far;
  }
  return static_cast<double>(near) > kMinNearFraction * static_cast<double>(count);
}

/// Iterated closest points, in both directions. Sets the similarity and the misfit; robust, that
/// is the larger of both directions' median distances.
void iterate_closest_points(Placement& start, const CoarseShape& source, const CoarseShape& target,
                            const MarkerPositions& marked, const ClosestPointsEffort& effort) {
  const Positions from =
      mirrored_if(rows_of(source.mesh.positions, source.samples, effort.samples), start.mirrored);
  const Positions marked_source = mirrored_if(marked.source, start.mirrored);
  const Positions onto = rows_of(target.mesh.positions, target.samples, effort.samples);
  const Index n = from.rows(), m = onto.rows(), k = marked.source.rows();
  Positions pairs_from(n + m + k, 3), pairs_onto(n + m + k, 3);
  Eigen::VectorXd weights(n + m + k);
  weights << Eigen::VectorXd::Constant(n + m, 1.0 / double(n + m)),
      Eigen::VectorXd::Constant(k, kMarkerWeight);
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
          mirrored_if(source.normals.row(source.samples[size_t(i)]), start.mirrored).transpose();
      const Eigen::Vector3d point = start.similarity(from.row(i).transpose());
      pairs_onto.row(i) = nearest_of(target, point, normal).transpose();
    }
    for (Index i = 0; i < m; ++i) {
      pairs_onto.row(n + i) = onto.row(i);
      Eigen::Vector3d normal =
          back.rotation * target.normals.row(target.samples[size_t(i)]).transpose();
      Eigen::Vector3d point = back(onto.row(i).transpose());
      if (start.mirrored) normal[0] *= -1, point[0] *= -1;
      pairs_from.row(n + i) =
          mirrored_if(nearest_of(source, point, normal).transpose(), start.mirrored);
    }
    const Positions misfits = start.similarity.all(pairs_from) - pairs_onto;
    if (effort.robust) {
      start.misfit = larger_median(misfits, n, m);
      const double near = kRobustMedians * std::max(kMinMedian, start.misfit);
      for (Index i = 0; i < n + m; ++i)
        weights[i] = geman_mcclure_weight(misfits.row(i).norm() / near) / double(n + m);
    } else {
      start.misfit = std::sqrt(misfits.topRows(n).rowwise().squaredNorm().mean()) +
                     std::sqrt(misfits.middleRows(n, m).rowwise().squaredNorm().mean());
      if (k > 0) start.misfit += std::sqrt(misfits.bottomRows(k).rowwise().squaredNorm().mean());
    }
    if (round == effort.rounds) break;
    // A median may stay while the rest still moves.
    if (round > 0 && !effort.robust &&
        std::abs(before - start.misfit) < kMaxConvergedMisfitChange * before)
      break;
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
  std::vector<Positions> chosen_samples;
  for (Placement& start : starts) {
    Positions own_samples = start.placed_samples(source, kQuickEffort.samples);
    const bool known =
        std::any_of(chosen_samples.begin(), chosen_samples.end(), [&](const Positions& other) {
          return (other - own_samples).rowwise().norm().mean() < kSamePlacementDistance;
        });
    if (known) continue;
    kept.push_back(start);
    chosen_samples.push_back(std::move(own_samples));
    if (kept.size() > most) break;
  }
  return kept;
}

}  // namespace

double Placement::preferred() const {
  return (misfit + kScoreOffset) * (as_they_stand ? kAsTheyStandFactor : 1);
}

bool Placement::fits_about_as(const Placement& best) const {
  return misfit + kScoreOffset < kAmbiguousMisfitRatio * (best.misfit + kScoreOffset);
}

Positions Placement::placed_samples(const CoarseShape& source, size_t count) const {
  return similarity.all(
      mirrored_if(rows_of(source.mesh.positions, source.samples, count), mirrored));
}

bool MarkerPositions::suffice() const {
  return source.rows() >= 3 && !are_collinear(source) && !are_collinear(target);
}

Placement placement_by(const MarkerPositions& marked, const CoarseShape& source,
                       const CoarseShape& target) {
  Placement found;
  found.similarity =
      fitted_similarity(marked.source, marked.target, Eigen::VectorXd::Ones(marked.source.rows()));
  // A few markers don't determine the scale reliably.
  if (marked.source.rows() < kMarkersForScale)
    iterate_closest_points(found, source, target, marked, kWholeEffort);
  return found;
}

std::vector<Placement> placement_candidates(const CoarseShape& source, const CoarseShape& target,
                                            const MarkerPositions& marked, ThreadPool& pool) {
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
    Placement& placement = all[size_t(i)];
    placement.as_they_stand = i == 0;
    placement.mirrored = size_t(i) >= count;
    placement.similarity.rotation = rotations[size_t(i) % count];
    placement.similarity.scale = onto.size / from.size;
    placement.similarity.shift =
        onto.centre.transpose() -
        placement.similarity.scale * (placement.similarity.rotation *
                                      mirrored_if(from.centre, placement.mirrored).transpose());
    iterate_closest_points(placement, source, target, marked, kQuickEffort);
  });
  all = best_of(std::move(all), source, kMaxPromising);
  pool.run(static_cast<int>(all.size()), [&](int i) {
    iterate_closest_points(all[size_t(i)], source, target, marked, kWholeEffort);
  });
  all = best_of(std::move(all), source, kMaxPromising);
  double least = all.front().misfit;
  for (const Placement& placement : all) least = std::min(least, placement.misfit);
  all.erase(std::remove_if(all.begin() + 1, all.end(),
                           [&](const Placement& placement) {
                             return placement.misfit + kScoreOffset >
                                    kMaxMisfitRatio * (least + kScoreOffset);
                           }),
            all.end());
  return all;
}

void remeasure_without_markers(Placement& placement, const CoarseShape& source,
                               const CoarseShape& target) {
  iterate_closest_points(placement, source, target, {}, kMeasureOnly);
}

std::optional<PartialFit> fit_partially(const std::vector<Placement>& starts,
                                        const CoarseShape& source, const CoarseShape& target,
                                        const MarkerPositions& marked, ThreadPool& pool) {
  std::vector<Placement> refined = starts;
  pool.run(static_cast<int>(starts.size()), [&](int i) {
    Placement& placement = refined[size_t(i)];
    if (!placement.mirrored)
      iterate_closest_points(placement, source, target, marked, kRobustEffort);
  });
  // The misfits of the starts decide, as those by robust weights don't tell details apart.
  std::vector<size_t> fitting;
  for (size_t i = 0; i < refined.size(); ++i) {
    if (!refined[i].mirrored && refined[i].misfit < kMaxPartialFitMedian &&
        keeps_markers(refined[i].similarity, marked))
      fitting.push_back(i);
  }
  if (fitting.empty()) return std::nullopt;
  const size_t best = *std::min_element(fitting.begin(), fitting.end(), [&](size_t a, size_t b) {
    return starts[a].preferred() < starts[b].preferred();
  });
  const Positions chosen_samples = refined[best].placed_samples(source, kQuickEffort.samples);
  const bool ambiguous = std::any_of(fitting.begin(), fitting.end(), [&](size_t i) {
    const Positions others = refined[i].placed_samples(source, kQuickEffort.samples);
    return starts[i].fits_about_as(starts[best]) &&
           (others - chosen_samples).rowwise().norm().mean() > kElsewhereDistance;
  });
  return PartialFit{refined[best].similarity, ambiguous};
}

bool part_lies_on_whole(const CoarseShape& source, const CoarseShape& target,
                        const MarkerPositions& marked, const Similarity& placement) {
  if (!keeps_markers(placement, marked)) return false;
  // kMaxPartialFitMedian of the larger box, as small distances there are large ones in the smaller
  // box.
  const double far = kMaxPartialFitMedian * std::max(1.0, placement.scale);
  const double source_distance = std::min(far, kMaxNearOfPart * placement.scale),
               target_distance = std::min(far, kMaxNearOfPart);
  return (is_open(source) && most_are_near(source, placement, target, source_distance)) ||
         (is_open(target) &&
          most_are_near(target, placement.inverse(), source, target_distance / placement.scale));
}

}  // namespace dd
