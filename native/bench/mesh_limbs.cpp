// SPDX-License-Identifier: GPL-3.0-or-later
// Limbs of any meshes with and without solidity, twisted and led aside: the least area of a
// cross-section over that at rest, the volume of the free part, stretch, and new intersecting
// pairs.
//
//   mesh_limbs FILE TIP HANDLE LENGTH [SPLITS]
//
// FILE: .off or .obj. TIP: a vertex. SPLITS: how often each triangle is split into four, as a
// twist by several turns needs many rows of them. Over the surface, what is nearer to the tip than
// HANDLE is the handle, what is farther than LENGTH is fixed, both as fractions of the box's
// diagonal. The limb runs from the fixed part to the handle; its sections are the lines of equal
// distance to the tip.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "cases.h"
#include "deform/deformer.h"
#include "mesh/geodesic_distances.h"
#include "mesh/measures.h"
#include "mesh/unit_box.h"
#include "mesh_files.h"
#include "support/rotations.h"

namespace {

using dd::Index;
using dd::Mesh;
using dd::Positions;
using dd::test::Affine;
using Vector = Eigen::RowVector3d;

constexpr int kSections = 60;

class Limb {
 public:
  Limb(Mesh mesh, int tip, double handle, double length) : mesh_(std::move(mesh)) {
    const double box = dd::bounding_box_diagonal(mesh_.positions);
    handle_ = handle * box;
    length_ = length * box;
    std::vector<char> sources(size_t(mesh_.vertex_count()), 0);
    sources.at(size_t(tip)) = 1;
    distance_ = dd::geodesic_distances(mesh_, sources);
    for (const double d : distance_) {
      roles_.push_back(d <= handle_ ? 0 : d < length_ ? dd::kFree : dd::kFixed);
      free_.push_back(roles_.back() == dd::kFree);
    }
    root_ = centre(mesh_.positions, length_);
    along_ = centre(mesh_.positions, handle_) - root_;
  }

  Affine twist(double degrees) const {
    return dd::test::rotation_about(dd::test::radians(degrees), along_.normalized().transpose(),
                                    root_.transpose(), Eigen::Vector3d::Zero());
  }
  Eigen::Vector3d twist_vector(double degrees) const {
    return dd::test::radians(degrees) * along_.normalized().transpose();
  }
  /// The handle goes to 0.7 lengths beside the root and 0.3 along, and does not turn.
  Affine led_down() const {
    Index least = 0;
    along_.cwiseAbs().minCoeff(&least);
    const Vector aside = along_.cross(Vector::Unit(least)).normalized();
    Affine motion = dd::test::identity();
    motion.col(3) = (0.7 * along_.norm() * aside - 0.7 * along_).transpose();
    return motion;
  }

  void print(const char* name, const Affine& motion, const Eigen::Vector3d& turn) const {
    for (const double solidity : {0.0, 1.0}) {
      dd::Deformer deformer(mesh_, roles_, 1, {});
      dd::UpdateOptions options;
      options.of_method.refined = {4, 0.009, 0.05, solidity};
      options.turns.assign(turn.data(), turn.data() + 3);
      const Positions p = mesh_.positions + deformer.update(motion.data(), options);
      const dd::Measures found = dd::measure(mesh_, p, free_);
      std::printf("  %-11s solidity %g: section %.3f  volume %.3f  stretch %.3f  new pairs %d\n",
                  name, solidity, least_section(p), volume(p) / volume(mesh_.positions),
                  found.stretch, found.new_intersecting_pairs);
    }
  }
  int free_count() const { return static_cast<int>(std::count(free_.begin(), free_.end(), 1)); }

 private:
  /// Calls use(a, b) with the segments of a line of equal distance to the tip, each in the sense of
  /// its triangle.
  template <class Use>
  void each_segment(const Positions& p, double distance, const Use& use) const {
    for (Index j = 0; j < mesh_.triangles.rows(); ++j) {
      const auto corner = mesh_.triangles.row(j);
      std::optional<Vector> in, out;
      for (int k = 0; k < 3; ++k) {
        const int a = corner[k], b = corner[(k + 1) % 3];
        const double da = distance_[size_t(a)], db = distance_[size_t(b)];
        if ((da < distance) == (db < distance)) continue;
        const double t = (distance - da) / (db - da);
        (da < distance ? out : in) = (1 - t) * p.row(a) + t * p.row(b);
      }
      if (in && out) use(*in, *out);
    }
  }
  Vector centre(const Positions& p, double distance) const {
    Vector sum = Vector::Zero();
    double length = 0;
    each_segment(p, distance, [&](const Vector& a, const Vector& b) {
      sum += 0.5 * (b - a).norm() * (a + b);
      length += (b - a).norm();
    });
    return sum / length;
  }
  double section(const Positions& p, double distance) const {
    Vector sum = Vector::Zero();
    each_segment(p, distance, [&](const Vector& a, const Vector& b) { sum += 0.5 * a.cross(b); });
    return sum.norm();
  }
  double least_section(const Positions& p) const {
    double least = 1e9;
    for (int k = 1; k < kSections; ++k) {
      const double distance = handle_ + (length_ - handle_) * k / kSections;
      least = std::min(least, section(p, distance) / section(mesh_.positions, distance));
    }
    return least;
  }
  /// Of the part whose triangles have a free corner, closed by cones over its two ends.
  double volume(const Positions& p) const {
    std::array<Vector, 2> of_end = {centre(p, handle_), centre(p, length_)};
    double sum = 0;
    for (Index j = 0; j < mesh_.triangles.rows(); ++j) {
      const auto corner = mesh_.triangles.row(j);
      const auto is_free = [&](int v) { return free_[size_t(v)] != 0; };
      if (!is_free(corner[0]) && !is_free(corner[1]) && !is_free(corner[2])) continue;
      sum += cone(of_end[1], p.row(corner[0]), p.row(corner[1]), p.row(corner[2]));
      for (int k = 0; k < 3; ++k)
        if (!is_free(corner[k]) && !is_free(corner[(k + 1) % 3]))
          sum += cone(of_end[1], p.row(corner[(k + 1) % 3]), p.row(corner[k]),
                      of_end[roles_[size_t(corner[k])] == 0 ? 0 : 1]);
    }
    return sum;
  }
  static double cone(const Vector& apex, const Vector& a, const Vector& b, const Vector& c) {
    return (a - apex).dot((b - apex).cross(c - apex)) / 6;
  }

  Mesh mesh_;
  std::vector<double> distance_;
  std::vector<int> roles_;
  std::vector<char> free_;
  double handle_ = 0, length_ = 0;
  Vector root_, along_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5 && argc != 6)
    return std::fprintf(stderr, "mesh_limbs FILE TIP HANDLE LENGTH [SPLITS]\n"), 2;
  try {
    dd::test::Case split;
    split.mesh = dd::bench::mesh_from_file(argv[1]);
    split.roles.assign(size_t(split.mesh.vertex_count()), dd::kFree);
    for (int k = argc == 6 ? std::atoi(argv[5]) : 0; k > 0; --k)
      split = dd::test::subdivided(std::move(split));
    const Limb limb(std::move(split.mesh), std::atoi(argv[2]), std::atof(argv[3]),
                    std::atof(argv[4]));
    std::printf("%s from vertex %s: %d free vertices\n", argv[1], argv[2], limb.free_count());
    for (const double degrees : {360.0, 720.0, 1080.0})
      limb.print(("twisted " + std::to_string(int(degrees))).c_str(), limb.twist(degrees),
                 limb.twist_vector(degrees));
    limb.print("led down", limb.led_down(), Eigen::Vector3d::Zero());
  } catch (const std::exception& error) {
    return std::fprintf(stderr, "%s\n", error.what()), 1;
  }
}
