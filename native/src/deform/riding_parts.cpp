// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/riding_parts.h"

#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>

#include "mesh/triangles.h"
#include "support/error.h"
#include "support/rotations.h"

namespace dd {

namespace {

// Fraction of a part's size: what is off by more counts by how many it is, not by how far. Tuned on
// Suzanne's eyes: as a brow or lid is pulled past them, they move by an eighth of it; with means,
// or up to 0.1, by a third.
constexpr double kAgrees = 0.02;
// The square of such a distance, as a fraction: up to this all count as they are.
constexpr double kAgreeWell = 0.01;
constexpr int kRounds = 4;  // of reweighting; with 20 those eyes move by 2% less
// Triangles. Hair cards ride on fewer: of these a median says no more than a mean.
constexpr int kLeastForMedian = 4;
// Least area, as a fraction of the largest: flat triangles count where there is nothing else.
// Safety: far below what single precision tells apart, 1e-7.
constexpr double kLeastArea = 1e-12;
// Of an offset, in any unit. Safety: half of what single precision holds.
constexpr double kLargest = 0.5 * std::numeric_limits<float>::max();
// Groups worth a task: each takes about as long as a few triangles of a frame.
constexpr int kLeastGroups = kLeastRange / 4;

bool is_index(int index, Index count) { return index >= 0 && index < count; }

void check(const Mesh& rest, const Pairs& riders, const Pairs& contacts,
           const std::vector<double>& sizes) {
  require(rest.positions.allFinite(), "mesh has coordinates that are not finite");
  const Index group_count = static_cast<Index>(sizes.size());
  for (double size : sizes)
    require(size >= 0 && std::isfinite(size),
            "options.sizes has a number that is not zero or more");
  std::vector<char> rides(rest.positions.rows(), 0), lies(sizes.size(), 0);
  for (const auto& [vertex, group] : riders) {
    require(is_index(vertex, rest.vertex_count()),
            "options.riders has a vertex that the mesh lacks");
    require(is_index(group, group_count), "options.riders has a group that has no size");
    if (rides[vertex])
      require(false, "options.riders has vertex " + std::to_string(vertex) + " twice");
    rides[vertex] = 1;
  }
  for (const auto& [group, triangle] : contacts) {
    require(is_index(group, group_count), "options.contacts has a group that has no size");
    require(is_index(triangle, rest.triangle_count()),
            "options.contacts has a triangle that the mesh lacks");
    lies[group] = 1;
    for (int corner : rest.triangles.row(triangle)) {
      const bool is_there = is_index(corner, rest.vertex_count());
      if (is_there && !rides[corner]) continue;
      const std::string name = "triangle " + std::to_string(triangle) + " of options.contacts has ";
      require(is_there, name + "a corner that the mesh lacks");
      require(false, name + "the corner " + std::to_string(corner) + ", which rides");
    }
  }
  for (size_t g = 0; g < lies.size(); ++g)
    if (!lies[g])
      require(false, "group " + std::to_string(g) + " has no triangle in options.contacts");
}

}  // namespace

/// The motion of one group in a pose. Kept between groups, so that its arrays are allocated once.
class RidingParts::GroupMotion {
 public:
  explicit GroupMotion(const RidingParts& parts) : parts_(parts) {}

  RigidMotion of(int g, const Offsets& offsets) {
    group_ = &parts_.groups_[g];
    beneath_.clear();
    motions_.clear();
    weights_.clear();
    for (int i = group_[0].first_contact; i < group_[1].first_contact; ++i) {
      const Beneath& triangle = parts_.beneath_[parts_.contacts_[i]];
      beneath_.push_back(&triangle);
      motions_.push_back(motion(triangle, offsets));
      weights_.push_back(triangle.area);
    }
    RigidMotion found = mean();
    if (group_->size > 0 && set_distances(found) >= kAgreeWell) {
      for (int round = 0; round < kRounds; ++round) {
        for (size_t i = 0; i < weights_.size(); ++i)
          weights_[i] = beneath_[i]->area / std::sqrt(1 + std::max(distances_[i] - kAgreeWell, 0.));
        found = mean();
        set_distances(found);
      }
    }
    return found;
  }

 private:
  static Motion motion(const Beneath& triangle, const Offsets& offsets) {
    const auto offset = [&](int k) -> Eigen::Vector3d {
      return offsets.row(triangle.corners[k]).transpose().cast<double>();
    };
    const Eigen::Vector3d first = offset(0), second = offset(1), third = offset(2);
    const Eigen::Vector3d shift = (first + second + third) / 3;
    if (triangle.inverse.isZero(0)) return {Eigen::Matrix3d::Identity(), shift};
    const Eigen::Matrix3d now =
        edges_and_normal(Eigen::Vector3d::Zero(), triangle.edges[0] + second - first,
                         triangle.edges[1] + third - first);
    return {now * triangle.inverse, shift};
  }

  RigidMotion mean() const {
    Eigen::Matrix3d gradient = Eigen::Matrix3d::Zero();
    Eigen::Vector3d shift = Eigen::Vector3d::Zero(), centre = Eigen::Vector3d::Zero();
    double sum = 0;
    for (size_t i = 0; i < weights_.size(); ++i) {
      gradient += weights_[i] * motions_[i].gradient;
      shift += weights_[i] * motions_[i].shift;
      centre += weights_[i] * (beneath_[i]->centroid - group_->centre);
      sum += weights_[i];
    }
    const Eigen::Matrix3d turn =
        polar_rotation_by_newton(gradient / sum) - Eigen::Matrix3d::Identity();
    // It takes the weighted centre at rest to the present one; c̄ is of all alike.
    return {shift / sum - turn * (centre / sum), turn};
  }

  /// Squared distances of the centroids from where a motion takes them, over those of kAgrees.
  /// Returns the largest.
  double set_distances(const RigidMotion& motion) {
    distances_.resize(motions_.size());
    const double unit = kAgrees * group_->size;
    for (size_t i = 0; i < motions_.size(); ++i) {
      const Eigen::Vector3d arm = beneath_[i]->centroid - group_->centre;
      distances_[i] =
          (motions_[i].shift - motion.shift - motion.turn * arm).squaredNorm() / (unit * unit);
    }
    return *std::max_element(distances_.begin(), distances_.end());
  }

  const RidingParts& parts_;
  const Group* group_ = nullptr;
  std::vector<const Beneath*> beneath_;
  std::vector<Motion> motions_;
  std::vector<double> weights_, distances_;
};

RidingParts::RidingParts(const Mesh& rest, const Pairs& riders, const Pairs& contacts,
                         const std::vector<double>& sizes, int threads)
    : vertex_count_(rest.vertex_count()), groups_(sizes.size() + 1), pool_(threads) {
  check(rest, riders, contacts, sizes);
  Pairs by_group = contacts;
  std::sort(by_group.begin(), by_group.end());
  by_group.erase(std::unique(by_group.begin(), by_group.end()), by_group.end());
  add_beneath(rest, by_group);
  std::vector<double> areas(groups_.size(), 0);
  for (size_t i = 0; i < by_group.size(); ++i) {
    const int g = by_group[i][0];
    const Beneath& triangle = beneath_[contacts_[i]];
    groups_[g].centre += triangle.area * triangle.centroid;
    areas[g] += triangle.area;
    ++groups_[g + 1].first_contact;
  }
  for (const auto& pair : riders) ++groups_[pair[1] + 1].first_rider;
  riders_.resize(riders.size());
  placed_.resize(riders.size());
  for (size_t g = 0; g < sizes.size(); ++g) {
    groups_[g].centre /= areas[g];
    if (groups_[g + 1].first_contact >= kLeastForMedian) groups_[g].size = sizes[g];
    groups_[g + 1].first_contact += groups_[g].first_contact;
    groups_[g + 1].first_rider += groups_[g].first_rider;
  }
  std::vector<int> next;
  next.reserve(groups_.size());
  for (const Group& group : groups_) next.push_back(group.first_rider);
  for (const auto& [vertex, g] : riders)
    riders_[next[g]++] = {vertex, rest.positions.row(vertex).transpose() - groups_[g].centre};
}

void RidingParts::add_beneath(const Mesh& rest, const Pairs& contacts) {
  std::vector<int> used;
  for (const auto& pair : contacts) used.push_back(pair[1]);
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  double largest = 0;
  for (int triangle : used) {
    const Eigen::Matrix3d edges = edges_and_normal(rest.positions, rest.triangles, triangle);
    Beneath added;
    added.corners = rest.triangles.row(triangle).transpose();
    added.area = edges.col(0).cross(edges.col(1)).norm() / 2;
    added.centroid = triangle_centre(rest.positions, rest.triangles, triangle);
    added.edges[0] = edges.col(0);
    added.edges[1] = edges.col(1);
    added.inverse.setZero();
    if (!edges.col(2).isZero(0)) added.inverse = edges.inverse();
    largest = std::max(largest, added.area);
    beneath_.push_back(added);
  }
  for (Beneath& triangle : beneath_)
    triangle.area = largest > 0 ? std::max(triangle.area, kLeastArea * largest) : 1;
  for (const auto& pair : contacts)
    contacts_.push_back(
        static_cast<int>(std::lower_bound(used.begin(), used.end(), pair[1]) - used.begin()));
}

bool RidingParts::moves(int group, const Offsets& offsets) const {
  for (int i = groups_[group].first_contact; i < groups_[group + 1].first_contact; ++i)
    for (int corner : beneath_[contacts_[i]].corners)
      if (!offsets.row(corner).isZero(0)) return true;
  return false;
}

void RidingParts::place(const Offsets& offsets, Placed placed) {
  std::atomic<bool> fits{true};
  const int group_count = static_cast<int>(groups_.size()) - 1;
  pool_.parallel_for(group_count, kLeastGroups, [&](int64_t begin, int64_t end) {
    GroupMotion motion(*this);
    for (int g = static_cast<int>(begin); g < end; ++g) {
      RigidMotion found{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Zero()};
      if (moves(g, offsets)) found = motion.of(g, offsets);
      for (int i = groups_[g].first_rider; i < groups_[g + 1].first_rider; ++i) {
        const Eigen::Vector3d offset = found.shift + found.turn * riders_[i].arm;
        if (!(offset.cwiseAbs().sum() < kLargest)) fits = false;
        placed_[i] = offset.cast<float>();
      }
    }
  });
  if (!fits) throw motion_too_large();
  for (size_t i = 0; i < riders_.size(); ++i)
    placed.row(riders_[i].vertex) = placed_[i].transpose();
}

}  // namespace dd
