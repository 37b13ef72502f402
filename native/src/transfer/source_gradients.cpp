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
constexpr double kMinPosedFlatness = 1e-5;
constexpr double kMaxAreaRatio = 8;         // of what a source triangle may serve to its own area
constexpr size_t kMaxTrianglesInMean = 64;  // bounds the time of a mean
// Least area in a ratio, as a fraction of the loose part's. Safety: avoids a division by zero.
constexpr double kMinOwnArea = 1e-12;

}  // namespace

SourceGradients::SourceGradients(const Mesh& source, const Mesh& target,
                                 const Correspondence& correspondence, const Similarity& placement)
    : source_(source),
      placement_(placement),
      active_index_(static_cast<size_t>(source.triangle_count()), -1) {
  record_sources(target, correspondence);
  if (!is_one_to_one()) find_overstretched(target);
  prepare();
  gradients_.resize(static_cast<size_t>(target.triangle_count()));
}

void SourceGradients::record_sources(const Mesh& target, const Correspondence& correspondence) {
  const int m = target.triangle_count();
  std::vector<int> filled_from(static_cast<size_t>(m), -1);
  for (int j = 0; j < m; ++j) {
    matched_.push_back(correspondence.has_source(j));
    if (matched_[j])
      filled_from[j] = j;
    else if (unmatched_count_++ == 0)
      unmatched_example_ = j;
  }
  if (unmatched_count_ == m)
    throw Error(Status::argument, "No triangle of the target corresponds to one of the source",
                Remedy::match_meshes);
  if (unmatched_count_ > 0)
    fill_from_neighbours(filled_from, target.triangles, target.vertex_count());

  for (int triangle : correspondence.source) sources_.push_back(active_index_of(triangle));
  for (int j = 0; j < m; ++j) {
    const bool any = filled_from[j] >= 0;
    begin_.push_back(any ? correspondence.begin[filled_from[j]] : 0);
    end_.push_back(any ? correspondence.begin[filled_from[j] + 1] : 0);
  }
}

int SourceGradients::active_index_of(int source_triangle) {
  int& active_index = active_index_[size_t(source_triangle)];
  if (active_index < 0) {
    active_index = static_cast<int>(active_.size());
    active_.push_back(source_triangle);
  }
  return active_index;
}

void SourceGradients::find_overstretched(const Mesh& target) {
  const Eigen::VectorXd areas = triangle_areas(source_.positions, source_.triangles);
  const Eigen::VectorXd target_areas = triangle_areas(target.positions, target.triangles);
  std::vector<double> served_areas(active_.size(), 0.0);
  for (int j = 0; j < target.triangle_count(); ++j)
    for (int k = begin_[j]; k < end_[j]; ++k)
      served_areas[size_t(sources_[k])] += target_areas[j] / (end_[j] - begin_[j]);

  // What a source triangle's area is compared with is the area that it serves, divided by the
  // growth of its loose part as a whole, since a head may be larger on the target; or by that of
  // the placement if that is larger, since a target that is a piece of the source asks for little
  // of the part's area.
  const Components parts(source_.triangles, source_.vertex_count());
  const auto part_of = [&](int triangle) {
    return size_t(parts.of_vertex[size_t(source_.triangles(triangle, 0))]);
  };
  std::vector<double> part_areas(size_t(parts.count), 0.0), part_served_areas(part_areas);
  for (int j = 0; j < source_.triangle_count(); ++j) part_areas[part_of(j)] += areas[j];
  for (size_t i = 0; i < served_areas.size(); ++i)
    part_served_areas[part_of(active_[i])] += served_areas[i];

  const Edges edges(source_.triangles);
  const std::vector<int> of_half_edges = edges.of_half_edges();
  const auto grow_neighbourhood = [&](std::vector<int>& neighbourhood, double& area,
                                      double wanted_area) {
    for (size_t next = 0; next < neighbourhood.size() && area < wanted_area; ++next)
      for (int k = 0; k < 3; ++k)
        for (const Edges::HalfEdge& side :
             edges.of(of_half_edges[3 * size_t(neighbourhood[next]) + k])) {
          if (neighbourhood.size() >= kMaxTrianglesInMean) return;
          if (std::find(neighbourhood.begin(), neighbourhood.end(), side.triangle()) !=
              neighbourhood.end())
            continue;
          neighbourhood.push_back(side.triangle());
          area += areas[side.triangle()];
        }
  };
  const double as_placed = 1 / (placement_.scale * placement_.scale);
  double largest_ratio = 0;
  for (int i = 0; i < static_cast<int>(served_areas.size()); ++i) {
    const size_t part = part_of(active_[i]);
    const double own = areas[active_[i]];
    if (!(part_areas[part] > 0)) continue;
    const double wanted_area =
        served_areas[i] * std::min(part_areas[part] / part_served_areas[part], as_placed);
    if (!(wanted_area > kMaxAreaRatio * own)) continue;
    std::vector<int> neighbourhood{active_[i]};
    double area = own;
    grow_neighbourhood(neighbourhood, area, wanted_area);
    if (!(area > 0)) continue;
    AreaMean mean{i, {}};
    for (int j : neighbourhood) mean.shares.emplace_back(active_index_of(j), areas[j] / area);
    means_.push_back(std::move(mean));
    const double ratio = wanted_area / std::max(own, kMinOwnArea * part_areas[part]);
    if (ratio > largest_ratio) {
      largest_ratio = ratio;
      overstretched_example_ = active_[i];
    }
  }
}

void SourceGradients::prepare() {
  stand_ins_ =
      stand_ins(source_.positions, source_.triangles, bounding_box_diagonal(source_.positions));
  RowOrder as_they_are;
  as_they_are.row_of_vertex.resize(static_cast<size_t>(source_.vertex_count()));
  std::iota(as_they_are.row_of_vertex.begin(), as_they_are.row_of_vertex.end(), 0);
  rotation_blocks_ = rotation_blocks<double>(source_.positions, source_.triangles, active_,
                                             stand_ins_, as_they_are);
  for (int triangle : active_) {
    const int j = stand_ins_.of_triangle[triangle];
    rest_inverse_.push_back(
        j < 0
            ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
            : Eigen::Matrix3d(edges_and_normal(source_.positions, source_.triangles, j).inverse()));
  }
  active_gradients_.resize(active_.size());
  source_rows_ = Rows::Zero(source_.vertex_count(), 4);
  quaternions_ = Rows::Zero(kLanes * static_cast<Index>(rotation_blocks_.size()), 4);
}

void SourceGradients::set_pose(const Positions& pose, bool rotation_only, ThreadPool& pool) {
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
  rotate_onto_target(pose, rotation_only, pool);
  apply_means(rotation_only);
  pool.parallel_for(static_cast<int64_t>(gradients_.size()), kLeastRange,
                    [&](int64_t begin, int64_t end) {
                      for (int64_t j = begin; j < end; ++j)
                        gradients_[j] = mean(static_cast<int>(j), rotation_only);
                    });
}

void SourceGradients::rotate_onto_target(const Positions& pose, bool rotation_only,
                                         ThreadPool& pool) {
  // Conjugation with a reflection F is that with −F, which is a rotation.
  const double sign = placement_.mirrored ? -1 : 1;
  const Eigen::Quaterniond placement_rotation(Eigen::Matrix3d(sign * placement_.rotation));
  pool.parallel_for(
      static_cast<int64_t>(active_.size()), kLeastRange, [&](int64_t begin, int64_t end) {
        for (int64_t i = begin; i < end; ++i) {
          const int j = stand_ins_.of_triangle[active_[i]];
          if (rotation_only) {
            quaternions_.row(i) =
                (placement_rotation * quaternion(quaternions_, i) * placement_rotation.conjugate())
                    .coeffs()
                    .transpose();
          } else if (j < 0) {
            active_gradients_[i].setIdentity();
          } else {
            active_gradients_[i] = placement_.rotation *
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
    return e.col(0).cross(e.col(1)).norm() > kMinPosedFlatness * longest;
  };
  std::vector<int> collapsed;
  for (size_t i = 0; i < active_.size(); ++i) {
    const int j = stand_ins_.of_triangle[active_[i]];
    if (j >= 0 && !has_area(j)) collapsed.push_back(static_cast<int>(i));
  }
  if (collapsed.empty()) return;
  std::vector<int> with_rotation(stand_ins_.of_triangle.size(), -1);
  for (int j = 0; j < source_.triangle_count(); ++j)
    if (stand_ins_.of_triangle[j] == j && has_area(j)) with_rotation[j] = j;
  fill_from_neighbours(with_rotation, source_.triangles, source_.vertex_count());
  for (int i : collapsed) {
    const int j = with_rotation[active_[i]];
    Eigen::Quaterniond rotation = Eigen::Quaterniond::Identity();
    if (j >= 0)
      rotation =
          polar_rotation(edges_and_normal(pose, source_.triangles, j) *
                         edges_and_normal(source_.positions, source_.triangles, j).inverse());
    quaternions_.row(i) = rotation.coeffs().transpose();
  }
}

Eigen::Matrix3d SourceGradients::mean_of(const VertexTriangles::Range& target_triangles) const {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  int count = 0;
  for (int j : target_triangles) {
    sum += gradients_[j];
    ++count;
  }
  return sum / std::max(count, 1);
}

void SourceGradients::apply_means(bool rotation_only) {
  std::vector<Eigen::Matrix3d> found;  // all before any is replaced, as the means overlap
  for (const AreaMean& mean : means_) {
    Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
    for (const auto& [i, share] : mean.shares)
      sum += share * (rotation_only ? quaternion(quaternions_, i).toRotationMatrix()
                                    : active_gradients_[size_t(i)]);
    found.push_back(sum);
  }
  for (size_t k = 0; k < means_.size(); ++k) {
    const int i = means_[k].of;
    if (rotation_only)
      quaternions_.row(i) = Eigen::Quaterniond(polar_rotation(found[k])).coeffs().transpose();
    else
      active_gradients_[size_t(i)] = found[k];
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
  Eigen::Matrix3d sum = active_gradients_[sources_[begin]];
  for (int k = begin + 1; k < end; ++k) sum += active_gradients_[sources_[k]];
  return sum / (end - begin);
}

bool SourceGradients::is_one_to_one() const {
  for (int j = 0; j < static_cast<int>(begin_.size()); ++j)
    if (end_[j] - begin_[j] != 1 || first_source(j) != j) return false;
  return true;
}

Eigen::Vector3d SourceGradients::centre_of_sources(const Positions& positions, int triangle) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = begin_[triangle]; k < end_[triangle]; ++k)
    sum += triangle_centre(positions, source_.triangles, active_[sources_[k]]);
  return sum / double(end_[triangle] - begin_[triangle]);
}

}  // namespace dd
