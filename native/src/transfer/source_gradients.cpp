// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/source_gradients.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <numeric>
#include <utility>

#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "support/error.h"
#include "support/rotations.h"

namespace dd {

namespace {

// Twice the area over the squared longer edge, below which a posed triangle has no rotation.
// Safety: there its normal is rounding.
constexpr double kFlatTriangle = 1e-5;
constexpr double kTooMuch = 8;      // multiple of its own area that a source triangle may serve
constexpr size_t kMostInMean = 64;  // triangles in a mean: bounds its time
// Least area in a ratio, as a fraction of the loose part's. Safety: avoids a division by zero.
constexpr double kLeastArea = 1e-12;

}  // namespace

SourceGradients::SourceGradients(const Mesh& source, const Mesh& target,
                                 const Correspondence& correspondence, const Similarity& placement)
    : source_(source),
      placement_(placement),
      number_(static_cast<size_t>(source.triangle_count()), -1) {
  match(target, correspondence);
  if (!is_one_to_one()) find_overstretched(target);
  prepare();
  gradients_.resize(static_cast<size_t>(target.triangle_count()));
}

void SourceGradients::match(const Mesh& target, const Correspondence& correspondence) {
  const int m = target.triangle_count();
  std::vector<int> matched_by(static_cast<size_t>(m), -1);
  for (int j = 0; j < m; ++j) {
    matched_.push_back(correspondence.has_source(j));
    if (matched_[j])
      matched_by[j] = j;
    else if (unmatched_count_++ == 0)
      unmatched_example_ = j;
  }
  if (unmatched_count_ == m)
    throw Error(Status::argument, "No triangle of the target corresponds to one of the source",
                Remedy::match_meshes);
  if (unmatched_count_ > 0)
    fill_from_neighbours(matched_by, target.triangles, target.vertex_count());

  for (int triangle : correspondence.source) sources_.push_back(numbered(triangle));
  for (int j = 0; j < m; ++j) {
    const bool any = matched_by[j] >= 0;
    begin_.push_back(any ? correspondence.begin[matched_by[j]] : 0);
    end_.push_back(any ? correspondence.begin[matched_by[j] + 1] : 0);
  }
}

int SourceGradients::numbered(int source_triangle) {
  int& number = number_[size_t(source_triangle)];
  if (number < 0) {
    number = static_cast<int>(used_.size());
    used_.push_back(source_triangle);
  }
  return number;
}

void SourceGradients::find_overstretched(const Mesh& target) {
  const Eigen::VectorXd areas = triangle_areas(source_.positions, source_.triangles);
  const Eigen::VectorXd target_areas = triangle_areas(target.positions, target.triangles);
  std::vector<double> asked(used_.size(), 0.0);
  for (int j = 0; j < target.triangle_count(); ++j)
    for (int k = begin_[j]; k < end_[j]; ++k)
      asked[size_t(sources_[k])] += target_areas[j] / (end_[j] - begin_[j]);

  // A loose part may be larger on the target as a whole, and the target may be a piece of the
  // source.
  const Components parts(source_.triangles, source_.vertex_count());
  const auto part_of = [&](int triangle) {
    return size_t(parts.of_vertex[size_t(source_.triangles(triangle, 0))]);
  };
  std::vector<double> own_area(size_t(parts.count), 0.0), asked_area(own_area);
  for (int j = 0; j < source_.triangle_count(); ++j) own_area[part_of(j)] += areas[j];
  for (size_t i = 0; i < asked.size(); ++i) asked_area[part_of(used_[i])] += asked[i];

  const Edges edges(source_.triangles);
  const std::vector<int> of_half_edges = edges.of_half_edges();
  const auto in_a_ring = [&](std::vector<int>& about, double& area, double wanted) {
    for (size_t next = 0; next < about.size() && area < wanted; ++next)
      for (int k = 0; k < 3; ++k)
        for (const Edges::HalfEdge& side : edges.of(of_half_edges[3 * size_t(about[next]) + k])) {
          if (about.size() >= kMostInMean) return;
          if (std::find(about.begin(), about.end(), side.triangle()) != about.end()) continue;
          about.push_back(side.triangle());
          area += areas[side.triangle()];
        }
  };
  const double as_placed = 1 / (placement_.scale * placement_.scale);
  double most = 0;
  for (int i = 0; i < static_cast<int>(asked.size()); ++i) {
    const size_t part = part_of(used_[i]);
    const double own = areas[used_[i]];
    if (!(own_area[part] > 0)) continue;
    const double wanted = asked[i] * std::min(own_area[part] / asked_area[part], as_placed);
    if (!(wanted > kTooMuch * own)) continue;
    std::vector<int> about{used_[i]};
    double area = own;
    in_a_ring(about, area, wanted);
    if (!(area > 0)) continue;
    Mean mean{i, {}};
    for (int j : about) mean.shares.emplace_back(numbered(j), areas[j] / area);
    means_.push_back(std::move(mean));
    const double ratio = wanted / std::max(own, kLeastArea * own_area[part]);
    if (ratio > most) {
      most = ratio;
      overstretched_example_ = used_[i];
    }
  }
}

void SourceGradients::prepare() {
  stand_ins_ =
      stand_ins(source_.positions, source_.triangles, bounding_box_diagonal(source_.positions));
  RowOrder as_they_are;
  as_they_are.row_of_vertex.resize(static_cast<size_t>(source_.vertex_count()));
  std::iota(as_they_are.row_of_vertex.begin(), as_they_are.row_of_vertex.end(), 0);
  rotation_blocks_ =
      rotation_blocks<double>(source_.positions, source_.triangles, used_, stand_ins_, as_they_are);
  for (int triangle : used_) {
    const int j = stand_ins_.of_triangle[triangle];
    rest_inverse_.push_back(
        j < 0
            ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
            : Eigen::Matrix3d(edges_and_normal(source_.positions, source_.triangles, j).inverse()));
  }
  used_gradients_.resize(used_.size());
  source_rows_ = Rows::Zero(source_.vertex_count(), 4);
  quaternions_ = Rows::Zero(kLanes * static_cast<Index>(rotation_blocks_.size()), 4);
}

void SourceGradients::take(const Positions& pose, bool rotation_only, ThreadPool& pool) {
  if (rotation_only) {
    source_rows_.leftCols<3>() = pose;
    pool.parallel_for(static_cast<int64_t>(rotation_blocks_.size()), kLeastRange / kLanes,
                      [&](int64_t begin, int64_t end) {
                        kernels().full.rotation_pass(
                            static_cast<int>(end - begin), rotation_blocks_.data() + begin,
                            source_rows_.data(), quaternions_.row(kLanes * begin).data());
                      });
    replace_collapsed(pose);
  }
  turn_onto_target(pose, rotation_only, pool);
  take_means(rotation_only);
  pool.parallel_for(static_cast<int64_t>(gradients_.size()), kLeastRange,
                    [&](int64_t begin, int64_t end) {
                      for (int64_t j = begin; j < end; ++j)
                        gradients_[j] = mean(static_cast<int>(j), rotation_only);
                    });
}

void SourceGradients::turn_onto_target(const Positions& pose, bool rotation_only,
                                       ThreadPool& pool) {
  // Conjugation with a reflection F is that with −F, which is a rotation.
  const double sign = placement_.mirrored ? -1 : 1;
  const Eigen::Quaterniond turn(Eigen::Matrix3d(sign * placement_.rotation));
  pool.parallel_for(
      static_cast<int64_t>(used_.size()), kLeastRange, [&](int64_t begin, int64_t end) {
        for (int64_t i = begin; i < end; ++i) {
          const int j = stand_ins_.of_triangle[used_[i]];
          if (rotation_only) {
            quaternions_.row(i) =
                (turn * quaternion(quaternions_, i) * turn.conjugate()).coeffs().transpose();
          } else if (j < 0) {
            used_gradients_[i].setIdentity();
          } else {
            used_gradients_[i] = placement_.rotation *
                                 edges_and_normal(pose, source_.triangles, j) * rest_inverse_[i] *
                                 placement_.rotation.transpose();
          }
        }
      });
}

void SourceGradients::replace_collapsed(const Positions& pose) {
  const auto has_area = [&](int j) {
    const Eigen::Matrix3d e = edges_and_normal(pose, source_.triangles, j);
    const double longest = std::max(e.col(0).squaredNorm(), e.col(1).squaredNorm());
    return e.col(0).cross(e.col(1)).norm() > kFlatTriangle * longest;
  };
  std::vector<int> collapsed;
  for (size_t i = 0; i < used_.size(); ++i) {
    const int j = stand_ins_.of_triangle[used_[i]];
    if (j >= 0 && !has_area(j)) collapsed.push_back(static_cast<int>(i));
  }
  if (collapsed.empty()) return;
  std::vector<int> turning(stand_ins_.of_triangle.size(), -1);
  for (int j = 0; j < source_.triangle_count(); ++j)
    if (stand_ins_.of_triangle[j] == j && has_area(j)) turning[j] = j;
  fill_from_neighbours(turning, source_.triangles, source_.vertex_count());
  for (int i : collapsed) {
    const int j = turning[used_[i]];
    Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
    if (j >= 0)
      rotation =
          polar_rotation(edges_and_normal(pose, source_.triangles, j) *
                         edges_and_normal(source_.positions, source_.triangles, j).inverse());
    quaternions_.row(i) = rotation.coeffs().transpose();
  }
}

Eigen::Matrix3d SourceGradients::mean_of(const Fans::Range& target_triangles) const {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  int count = 0;
  for (int j : target_triangles) {
    sum += gradients_[j];
    ++count;
  }
  return sum / std::max(count, 1);
}

void SourceGradients::take_means(bool rotation_only) {
  std::vector<Eigen::Matrix3d> found;  // all before any is replaced, as the means overlap
  for (const Mean& mean : means_) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const auto& [i, share] : mean.shares)
      sum += share * (rotation_only ? quaternion(quaternions_, i).toRotationMatrix()
                                    : used_gradients_[size_t(i)]);
    found.push_back(sum);
  }
  for (size_t k = 0; k < means_.size(); ++k) {
    const int i = means_[k].of;
    if (rotation_only)
      quaternions_.row(i) = Eigen::Quaterniond(polar_rotation(found[k])).coeffs().transpose();
    else
      used_gradients_[size_t(i)] = found[k];
  }
}

Eigen::Matrix3d SourceGradients::mean(int triangle, bool rotation_only) const {
  const int begin = begin_[triangle], end = end_[triangle];
  if (begin == end) return Eigen::Matrix3d::Identity();
  if (rotation_only) {
    // With signs as the first one's: q and −q are the same rotation.
    const Eigen::Vector4d first = quaternions_.row(sources_[begin]);
    Eigen::Vector4d sum = first;
    for (int k = begin + 1; k < end; ++k) {
      const Eigen::Vector4d other = quaternions_.row(sources_[k]);
      sum += other.dot(first) < 0 ? Eigen::Vector4d(-other) : other;
    }
    return Eigen::Quaterniond(sum).normalized().toRotationMatrix();
  }
  Eigen::Matrix3d sum = used_gradients_[sources_[begin]];
  for (int k = begin + 1; k < end; ++k) sum += used_gradients_[sources_[k]];
  return sum / (end - begin);
}

bool SourceGradients::is_one_to_one() const {
  for (int j = 0; j < static_cast<int>(begin_.size()); ++j)
    if (end_[j] - begin_[j] != 1 || first_source(j) != j) return false;
  return true;
}

Eigen::Vector3d SourceGradients::centre_of_sources(const Positions& places, int triangle) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = begin_[triangle]; k < end_[triangle]; ++k)
    sum += triangle_centre(places, source_.triangles, used_[sources_[k]]);
  return sum / double(end_[triangle] - begin_[triangle]);
}

}  // namespace dd
