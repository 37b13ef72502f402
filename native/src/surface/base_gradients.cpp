// SPDX-License-Identifier: GPL-3.0-or-later
#include "surface/base_gradients.h"

#include <Eigen/LU>

#include "mesh/topology.h"
#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "support/rotations.h"
#include "surface/corner_flux.h"
#include "surface/gradients.h"

namespace dd {

namespace {

/// For each component the handle that alone holds it, by two vertices or more; else -1.
std::vector<int> lone_handles(const Region& region, const Components& components) {
  constexpr int kNone = -1;
  std::vector<int> handle(static_cast<size_t>(components.count), kNone);
  std::vector<int> held(static_cast<size_t>(components.count), 0);
  std::vector<char> mixed(static_cast<size_t>(components.count), 0);
  for (size_t v = 0; v < region.role.size(); ++v) {
    const int role = region.role[v], component = components.of_vertex[v];
    if (role == kFree) continue;
    if (held[component]++ == 0) handle[component] = role;
    mixed[component] |= handle[component] != role;
  }
  for (size_t c = 0; c < handle.size(); ++c)
    if (mixed[c] || held[c] < 2 || handle[c] < 0) handle[c] = kNone;
  return handle;
}

/// The active triangles, by their places, for which no triangle of their component can stand in.
std::vector<int> without_stand_in(const StandIns& stand_ins, const ActiveTriangles& active) {
  std::vector<int> places;
  for (int i = 0; i < active.size(); ++i)
    if (stand_ins.of_triangle[active.triangles[i]] < 0) places.push_back(i);
  return places;
}

template <class Real>
class BaseGradientsOf : public BaseGradients {
 public:
  explicit BaseGradientsOf(const BoundSurface& bound)
      : bound_(bound),
        stand_ins_(stand_ins(bound.base, bound.operators.triangles,
                             bounding_box_diagonal(bound.mesh.positions))),
        pass_(bound, bound.base, stand_ins_),
        collapsed_(bound, without_stand_in(stand_ins_, bound.poisson->active())),
        base_(&bound.rest_base) {
    for (int j : bound.poisson->active().triangles)
      stand_in_count_ += stand_ins_.of_triangle[j] != j;
    if (bound.operators.flipped)
      of_faces_ =
          stand_ins(bound.base, bound.mesh.triangles, bounding_box_diagonal(bound.mesh.positions))
              .of_triangle;
    if (collapsed_.size() > 0) {
      const Components components(bound.mesh.triangles, bound.mesh.vertex_count());
      const std::vector<int> lone = lone_handles(bound.region, components);
      handle_of_.assign(static_cast<size_t>(bound.mesh.triangle_count()), -1);
      for (int j = 0; j < bound.mesh.triangle_count(); ++j)
        handle_of_[j] = lone[components.of_vertex[bound.mesh.triangles(j, 0)]];
    }
    const std::vector<Eigen::Matrix3d> still(static_cast<size_t>(bound.region.handle_count),
                                             Eigen::Matrix3d::Identity());
    for (bool rotation_only : {false, true}) {
      take(bound.rest_base, still, rotation_only);
      Rows& rows = at_rest_[rotation_only];
      rows = Rows::Zero(bound.poisson->right_hand_side_rows(), 4);
      for (int section = 0; section < bound.poisson->active().sections(); ++section)
        add(section, rows.data());
    }
  }

  void take(const Rows& base, const std::vector<Eigen::Matrix3d>& linear,
            bool rotation_only) override {
    base_ = &base;
    rotation_only_ = rotation_only;
    if (collapsed_.size() == 0) return;
    of_handles_ = linear;
    if (rotation_only)
      for (Eigen::Matrix3d& gradient : of_handles_) gradient = polar_rotation(gradient);
  }

  void add(int section, double* rows) const override {
    pass_.add(section, base_->data(), rotation_only_, rows);
    collapsed_.add(
        section, [&](int, int triangle) { return of_collapsed(triangle); }, rows);
  }

  const Rows& at_rest() const override { return at_rest_[rotation_only_]; }

  Eigen::Matrix3d at(int face) const override {
    const Triangles& t = bound_.mesh.triangles;
    const int j = of_faces_.empty() ? stand_ins_.of_triangle[face] : of_faces_[face];
    if (j < 0) return of_collapsed(face);
    const auto place = [&](int k) -> Eigen::Vector3d {
      return Eigen::Vector3d::Map(base_->data() + 4 * Index(bound_.order().row_of_vertex[t(j, k)]));
    };
    const Eigen::Matrix3d S = edges_and_normal(place(0), place(1), place(2)) *
                              edges_and_normal(bound_.base, t, j).inverse();  // (15)
    return rotation_only_ ? polar_rotation(S) : S;
  }

  int stand_in_count() const override { return stand_in_count_; }

  double bytes() const override {
    return pass_.bytes() + collapsed_.bytes() +
           static_cast<double>(
               (stand_ins_.of_triangle.size() + of_faces_.size() + handle_of_.size()) *
               sizeof(int)) +
           static_cast<double>((at_rest_[0].size() + at_rest_[1].size()) * Index(sizeof(double)));
  }

 private:
  /// A component whose whole base is a point or a line, held by a single handle, goes with that
  /// handle's matrix. Held by several, or by one vertex, it has none to go by: S_j = I.
  Eigen::Matrix3d of_collapsed(int triangle) const {
    const int handle = handle_of_[triangle];
    return handle < 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : of_handles_[handle];
  }

  const BoundSurface& bound_;
  StandIns stand_ins_;
  std::vector<int> of_faces_;  // the same of the mesh's own triangles, where these are others
  GradientPass<Real> pass_;
  CornerFlux collapsed_;        // of what nothing stands in for
  std::vector<int> handle_of_;  // of triangles, where there are such
  int stand_in_count_ = 0;
  Rows at_rest_[2];  // whole gradients, rotations
  // Of the present pose.
  const Rows* base_;
  bool rotation_only_ = false;
  std::vector<Eigen::Matrix3d> of_handles_;
};

}  // namespace

std::unique_ptr<BaseGradients> make_base_gradients(const BoundSurface& bound) {
  if (bound.poisson->precision() == Precision::single)
    return std::make_unique<BaseGradientsOf<float>>(bound);
  return std::make_unique<BaseGradientsOf<double>>(bound);
}

}  // namespace dd
