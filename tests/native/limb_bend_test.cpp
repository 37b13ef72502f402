// SPDX-License-Identifier: GPL-3.0-or-later
// The rotations of limbs whose base is a thread.
#include "reconstruction/limb_bend.h"

#include <cmath>

#include "base/bound_surface.h"
#include "catch.h"
#include "mesh/unit_box.h"
#include "tapered_limb.h"

using namespace dd;
using namespace dd::test;

namespace {

/// A tapered limb with its base, and R_B on it.
struct Thread {
  explicit Thread(const TaperedLimb& limb)
      : pool(1),
        region(make_region(limb.mesh, limb.roles, 1, MovedBy::handles)),
        box(limb.mesh.positions),
        bound(Mesh{box.into(limb.mesh.positions), limb.mesh.triangles}, region, {}, pool, {}),
        sections(find_cross_sections(bound)),
        bend(bound, *sections, bound.base, 1) {}

  /// R_0, of all rows one rotation.
  Rows even(const Eigen::Quaterniond& rotation) const {
    return rotation.coeffs().transpose().replicate(bound.order().count(), 1);
  }
  /// Calls use(row, R_B) for the free rows whose base is a thread.
  template <class Use>
  void each(const Rows& base, const Rows& even, const Use& use) const {
    int count = 0;
    for (Index row = 0; row < bound.order().free_count; ++row) {
      if (bend.weights()[row] < 0.9) continue;
      use(row, bend.rotation(base, even, row));
      ++count;
    }
    CHECK(count > bound.order().free_count / 5);
  }

  ThreadPool pool;
  Region region;
  UnitBox box;
  BoundSurface bound;
  std::unique_ptr<CrossSections> sections;
  LimbBend bend;
};

/// The base, a thread along z, wound to an arc in the plane of x and z, a turn of so many radians
/// a unit of length.
Rows wound(const Thread& thread, double rate) {
  Rows base = thread.bound.rest_base;
  for (Index row = 0; row < base.rows(); ++row) {
    const double x = base(row, 0), z = base(row, 2), angle = rate * z;
    base(row, 0) = (1 - std::cos(angle)) / rate + x * std::cos(angle);
    base(row, 2) = std::sin(angle) / rate - x * std::sin(angle);
  }
  return base;
}

double angle_between(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b) {
  return a.angularDistance(b);
}

}  // namespace

TEST_CASE("a limb turns with its base's tangent, and about it as the handles do") {
  const Thread thread(TaperedLimb(0.3, 0.1, 1, 2));
  const double rate = 3;
  const Rows base = wound(thread, rate);
  for (const double twist : {0.0, 1.0, 4.0}) {
    const Eigen::Quaterniond even(Eigen::AngleAxisd(twist, Eigen::Vector3d::UnitZ()));
    INFO("twisted by " << twist);
    thread.each(base, thread.even(even), [&](Index row, const Eigen::Quaterniond& found) {
      // The plane of the arc is that of x and z: its rotation is about y, by the angle wound.
      const Eigen::Quaterniond arc(
          Eigen::AngleAxisd(rate * thread.bound.rest_base(row, 2), Eigen::Vector3d::UnitY()));
      CHECK(angle_between(found, arc * even) < 0.03);
    });
  }
}

TEST_CASE("a limb's rotations by its base: I at rest, and a rigid motion's") {
  const Thread thread(TaperedLimb(0.5, 0.06, 0.6, 1, 0.08));
  const Eigen::Quaterniond rotation(
      Eigen::AngleAxisd(2.5, Eigen::Vector3d(1, -2, 0.5).normalized()));
  for (const Eigen::Quaterniond& moved : {Eigen::Quaterniond::Identity(), rotation}) {
    Rows base = thread.bound.rest_base;
    for (Index row = 0; row < base.rows(); ++row)
      base.row(row).head<3>() =
          (moved * base.row(row).head<3>().transpose()).transpose() + Eigen::RowVector3d(1, 2, 3);
    const auto is_moved = [&](Index, const Eigen::Quaterniond& found) {
      CHECK(angle_between(found, moved) < 1e-6);
    };
    thread.each(base, thread.even(moved), is_moved);
    // Given rotations give way in the proportion of the weights, those at rims stay.
    const Index free_count = thread.bound.order().free_count;
    const Eigen::Quaterniond given(0.5, 0.5, 0.5, 0.5);
    std::vector<double> rotations;
    for (int i = 0; i < thread.bound.poisson->active_vertex_count(); ++i)
      rotations.insert(rotations.end(), given.coeffs().data(), given.coeffs().data() + 4);
    thread.bend.run(base, thread.even(moved), rotations);
    for (size_t i = 0; i < rotations.size() / 4; ++i) {
      const Eigen::Map<const Eigen::Quaterniond> mixed(&rotations[4 * i]);
      const double weight = Index(i) < free_count ? thread.bend.weights()[Index(i)] : 0;
      const double all = angle_between(given, moved);
      CHECK(angle_between(given, mixed) + angle_between(mixed, moved) == Approx(all));
      if (weight == 0) CHECK(angle_between(given, mixed) < 1e-12);
      if (weight > 0.99) CHECK(angle_between(mixed, moved) < 0.05);
    }
  }
}
