// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <vector>

#include "mesh/correspondence.h"
#include "mesh/mesh.h"
#include "support/thread_pool.h"

namespace dd {

/// Loose parts that ride on a surface, such as plates, rivets, eyes and hair cards: groups of
/// vertices p, each of which moves rigidly with the triangles j beneath it. With their areas m_j
/// and centroids c_j at rest, the deformed centroids c'_j and the gradients S_j of (15),
///
///   p' = c̄' + R (p − c̄),   R = polar(Σ m_j S_j),   c̄ = Σ m_j c_j / Σ m_j,   c̄' as c̄ of c'_j.
///
/// Where what is beneath moves apart, so that some c'_j are farther than kAgrees of the part's size
/// from where this takes c_j, the mean gives way to the median: iteratively, m_j are divided by
/// these distances. So an eye stays in its socket while a lid closes.
class RidingParts {
 public:
  /// rest: the mesh, of which triangles that are no contact aren't looked at. riders: pairs of a
  /// vertex and its group. contacts: pairs of a group and a triangle on which it rides. sizes: of
  /// each group's part, in the unit of the positions; 0: it moves by means. Throws Error(argument)
  /// for what is out of range, for a vertex in two groups, a group without a contact, and a contact
  /// with a corner that rides.
  RidingParts(const Mesh& rest, const Pairs& riders, const Pairs& contacts,
              const std::vector<double>& sizes, int threads);

  int vertex_count() const { return vertex_count_; }

  using FloatRows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;
  using Offsets = Eigen::Ref<const FloatRows, Eigen::Unaligned, Eigen::OuterStride<>>;
  using Placed = Eigen::Ref<FloatRows, Eigen::Unaligned, Eigen::OuterStride<>>;
  /// offsets: n×3, of the vertices from rest. Writes those of the riders, and no others, to placed,
  /// which may be the same memory. Of a group beneath which nothing moves they are zero. Throws
  /// Error(numeric), with nothing written, where one leaves the range of single precision.
  void place(const Offsets& offsets, Placed placed);

 private:
  struct Beneath {  // a triangle
    Eigen::Vector3i corners;
    double area;
    Eigen::Vector3d centroid;
    Eigen::Vector3d edges[2];  // from the first corner
    Eigen::Matrix3d inverse;   // of these and the normal; zero where it has no area
  };
  struct Motion {  // of such a triangle
    Eigen::Matrix3d gradient;
    Eigen::Vector3d shift;  // of the centroid
  };
  struct Rider {
    int vertex;
    Eigen::Vector3d arm;  // p − c̄
  };
  struct Group {
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();
    double size = 0;                         // 0: it moves by means
    int first_contact = 0, first_rider = 0;  // up to those of the next group
  };
  struct RigidMotion {  // p' − p = shift + turn (p − c̄)
    Eigen::Vector3d shift;
    Eigen::Matrix3d turn;  // R − I
  };
  class GroupMotion;
  void add_beneath(const Mesh& rest, const Pairs& contacts);
  bool moves(int group, const Offsets& offsets) const;

  int vertex_count_;
  std::vector<Beneath> beneath_;         // each triangle once
  std::vector<int> contacts_;            // by groups, of beneath_
  std::vector<Rider> riders_;            // by groups
  std::vector<Eigen::Vector3f> placed_;  // their offsets
  std::vector<Group> groups_;            // and one more, which ends the last one
  ThreadPool pool_;
};

}  // namespace dd
