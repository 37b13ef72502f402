// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/source_gradients.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <numeric>

#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "support/error.h"
#include "support/rotations.h"

namespace dd {

namespace {

// Area over squared edge of a posed triangle that has no rotation.
constexpr double kCollapsed = 1e-5;

}  // namespace

SourceGradients::SourceGradients(const Mesh& source, const Triangles& target,
                                 int target_vertex_count, const Correspondence& correspondence,
                                 const Similarity& placement)
    : source_(source), placement_(placement) {
  match(target, target_vertex_count, correspondence);
  prepare();
  gradients_.resize(static_cast<size_t>(target.rows()));
}

void SourceGradients::match(const Triangles& target, int target_vertex_count,
                            const Correspondence& correspondence) {
  const int m = static_cast<int>(target.rows());
  std::vector<int> matched_by(static_cast<size_t>(m), -1);
  for (int j = 0; j < m; ++j) {
    matched_.push_back(correspondence.has_source(j));
    if (matched_[j])
      matched_by[j] = j;
    else if (unmatched_count_++ == 0)
      unmatched_example_ = j;
  }
  if (unmatched_count_ == m)
    throw Error(Status::argument, "No triangle of the target corresponds to one of the source.");
  if (unmatched_count_ > 0) fill_from_neighbours(matched_by, target, target_vertex_count);

  std::vector<int> number(static_cast<size_t>(source_.triangle_count()), -1);
  for (int triangle : correspondence.source) {
    if (number[triangle] < 0) {
      number[triangle] = static_cast<int>(used_.size());
      used_.push_back(triangle);
    }
    sources_.push_back(number[triangle]);
  }
  for (int j = 0; j < m; ++j) {
    const bool any = matched_by[j] >= 0;
    begin_.push_back(any ? correspondence.begin[matched_by[j]] : 0);
    end_.push_back(any ? correspondence.begin[matched_by[j] + 1] : 0);
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
  pool.parallel_for(static_cast<int64_t>(gradients_.size()), kLeastRange,
                    [&](int64_t begin, int64_t end) {
                      for (int64_t j = begin; j < end; ++j)
                        gradients_[j] = mean(static_cast<int>(j), rotation_only);
                    });
}

void SourceGradients::turn_onto_target(const Positions& pose, bool rotation_only,
                                       ThreadPool& pool) {
  const Eigen::Quaterniond turn(placement_.rotation);
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
    return e.col(0).cross(e.col(1)).norm() > kCollapsed * longest;
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

Eigen::Matrix3d SourceGradients::mean(int triangle, bool rotation_only) const {
  const int begin = begin_[triangle], end = end_[triangle];
  if (begin == end) return Eigen::Matrix3d::Identity();
  if (rotation_only) {
    // Their signs made to agree: a rotation has two quaternions.
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

Eigen::Vector3d SourceGradients::centre_of_sources(const Positions& places, int triangle) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = begin_[triangle]; k < end_[triangle]; ++k)
    sum += triangle_centre(places, source_.triangles, used_[sources_[k]]);
  return sum / double(end_[triangle] - begin_[triangle]);
}

}  // namespace dd
