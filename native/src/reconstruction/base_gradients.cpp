// SPDX-License-Identifier: GPL-3.0-or-later
#include "reconstruction/base_gradients.h"

#include <Eigen/LU>

#include "mesh/triangles.h"
#include "mesh/unit_box.h"
#include "reconstruction/corner_flux.h"
#include "reconstruction/gradients.h"
#include "reconstruction/whole_surface.h"
#include "support/rotations.h"

namespace dd {

namespace {

/// For each component the handle that contains all of its constrained vertices, two or more of
/// them; else -1.
std::vector<int> lone_handles(const Region& region, const Components& components) {
  constexpr int kNone = -1;
  std::vector<int> handle(static_cast<size_t>(components.count), kNone);
  std::vector<int> constrained_count(static_cast<size_t>(components.count), 0);
  std::vector<char> mixed(static_cast<size_t>(components.count), 0);
  for (size_t v = 0; v < region.role.size(); ++v) {
    const int role = region.role[v], component = components.of_vertex[v];
    if (role == kFree) continue;
    if (constrained_count[component]++ == 0) handle[component] = role;
    mixed[component] |= handle[component] != role;
  }
  for (size_t c = 0; c < handle.size(); ++c)
    if (mixed[c] || constrained_count[c] < 2 || handle[c] < 0) handle[c] = kNone;
  return handle;
}

/// The active triangles, as indices into active.triangles, without a stand-in in their component.
std::vector<int> without_stand_in(const StandIns& stand_ins, const ActiveTriangles& active) {
  std::vector<int> indices;
  for (int i = 0; i < active.size(); ++i)
    if (stand_ins.of_triangle[active.triangles[i]] < 0) indices.push_back(i);
  return indices;
}

template <class Real>
class BaseGradientsOf : public BaseGradients {
 public:
  BaseGradientsOf(const FactoredSurface& surface, const Positions& base)
      : surface_(surface),
        rest_(base),
        stand_ins_(stand_ins(base, surface.operators.triangles,
                             bounding_box_diagonal(surface.mesh.positions))) {
    for (int j : surface.poisson->active().triangles)
      stand_in_count_ += stand_ins_.of_triangle[j] != j;
  }

  void take(const BasePose& pose, bool rotation_only) override {
    if (!passes_) passes_ = prepared();
    set(pose, rotation_only);
  }

  void add(int section, double* rows) const override { add_by(*passes_, section, rows); }

  const Rows& at_rest() const override { return passes_->at_rest[rotation_only_]; }

  Eigen::Matrix3d at(int face) const override {
    const Triangles& t = surface_.mesh.triangles;
    const int j = of_faces_.empty() ? stand_ins_.of_triangle[face] : of_faces_[face];
    if (j < 0) return of_collapsed(face);
    const auto position = [&](int k) -> Eigen::Vector3d {
      return Eigen::Vector3d::Map(base_->data() +
                                  4 * Index(surface_.order().row_of_vertex[t(j, k)]));
    };
    const Eigen::Matrix3d S = edges_and_normal(position(0), position(1), position(2)) *
                              edges_and_normal(rest_, t, j).inverse();  // (15)
    return rotation_only_ ? polar_rotation(S) : S;
  }

  int stand_in_count() const override { return stand_in_count_; }

  double bytes() const override {
    const auto ints = stand_ins_.of_triangle.size() + of_faces_.size() + handle_of_.size();
    return static_cast<double>(ints * sizeof(int)) +
           (passes_ ? passes_->pass.bytes() + passes_->collapsed.bytes() +
                          static_cast<double>(2 * passes_->at_rest[0].size()) * sizeof(double)
                    : 0);
  }

 private:
  /// Made by the first take().
  struct Passes {
    GradientPass<Real> pass;
    CornerFlux collapsed;  // for triangles without a stand-in
    Rows at_rest[2];       // by rotation_only
  };

  std::unique_ptr<Passes> prepared() {
    const Mesh& mesh = surface_.mesh;
    if (surface_.operators.flipped)
      of_faces_ =
          stand_ins(rest_, mesh.triangles, bounding_box_diagonal(mesh.positions)).of_triangle;
    auto made = std::make_unique<Passes>(
        Passes{{surface_, rest_, stand_ins_},
               CornerFlux(surface_, without_stand_in(stand_ins_, surface_.poisson->active())),
               {}});
    handle_of_.clear();
    if (made->collapsed.size() > 0) {
      const Components components = components_of(surface_);
      const std::vector<int> lone = lone_handles(surface_.region, components);
      handle_of_.assign(static_cast<size_t>(mesh.triangle_count()), -1);
      for (int j = 0; j < mesh.triangle_count(); ++j)
        handle_of_[j] = lone[components.of_vertex[mesh.triangles(j, 0)]];
    }
    const std::vector<Eigen::Matrix3d> still(static_cast<size_t>(surface_.region.handle_count),
                                             Eigen::Matrix3d::Identity());
    const Rows rest = in_order(rest_, surface_.order());
    for (bool rotation_only : {false, true}) {
      set({rest, still}, rotation_only);
      Rows& rows = made->at_rest[rotation_only];
      rows = Rows::Zero(surface_.poisson->right_hand_side_rows(), 4);
      for (int section = 0; section < surface_.poisson->active().sections(); ++section)
        add_by(*made, section, rows.data());
    }
    return made;
  }

  void add_by(const Passes& passes, int section, double* rows) const {
    passes.pass.add(section, base_->data(), rotation_only_, rows);
    passes.collapsed.add(section, [&](int, int triangle) { return of_collapsed(triangle); }, rows);
  }

  void set(const BasePose& pose, bool rotation_only) {
    base_ = &pose.base;
    rotation_only_ = rotation_only;
    if (handle_of_.empty()) return;
    of_handles_ = pose.linear;
    if (rotation_only)
      for (Eigen::Matrix3d& gradient : of_handles_) gradient = polar_rotation(gradient);
  }

  /// The gradient of a component whose base is a point or a line: that of the handle which alone
  /// holds the component by two vertices or more, else I.
  Eigen::Matrix3d of_collapsed(int triangle) const {
    const int handle = handle_of_[triangle];
    return handle < 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity()) : of_handles_[handle];
  }

  const FactoredSurface& surface_;
  const Positions& rest_;  // B
  StandIns stand_ins_;
  std::vector<int> of_faces_;  // stand-ins among the mesh's own triangles, if any edge was flipped
  // see lone_handles(), by triangle; only with triangles without a stand-in
  std::vector<int> handle_of_;
  int stand_in_count_ = 0;
  std::unique_ptr<Passes> passes_;
  // Of the current pose:
  const Rows* base_ = nullptr;
  bool rotation_only_ = false;
  std::vector<Eigen::Matrix3d> of_handles_;
};

}  // namespace

std::unique_ptr<BaseGradients> make_base_gradients(const FactoredSurface& surface,
                                                   const Positions& base) {
  if (surface.poisson->precision() == Precision::single)
    return std::make_unique<BaseGradientsOf<float>>(surface, base);
  return std::make_unique<BaseGradientsOf<double>>(surface, base);
}

}  // namespace dd
