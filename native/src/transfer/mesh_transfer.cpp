// SPDX-License-Identifier: GPL-3.0-or-later
#include "transfer/mesh_transfer.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <numeric>
#include <string>
#include <utility>

#include "support/rotations.h"
#include "surface/free_block.h"
#include "surface/volumetric_transfer.h"

namespace dd {

namespace {

constexpr int kLeastRange = 512;  // triangles that are worth a task
constexpr double kCollapsed =
    1e-5;                        // area over squared edge of a posed triangle that has no rotation
constexpr double kStill = 1e-2;  // ‖S_j − I‖ below which a triangle is as good as one that rests

Mesh validated(Mesh mesh, const char* which) {
  validate(mesh, which);
  return mesh;
}

Eigen::VectorXd triangle_areas(const Mesh& mesh) {
  Eigen::VectorXd areas(mesh.triangle_count());
  for (Index j = 0; j < areas.size(); ++j) {
    const Eigen::Matrix3d e = edges_and_normal(mesh.positions, mesh.triangles, j);
    areas[j] = 0.5 * e.col(0).cross(e.col(1)).norm();
  }
  return areas;
}

std::vector<int> checked_anchors(const TransferOptions& options, const Mesh& target) {
  if (options.anchor == Anchor::source || options.anchor == Anchor::centroid) return {};
  if (options.anchors.empty())
    throw Error(Status::argument, "There is no anchor: name the vertices that stay in place.");
  std::vector<char> seen(static_cast<size_t>(target.vertex_count()), 0);
  for (int v : options.anchors) {
    if (v < 0 || v >= target.vertex_count())
      throw Error(Status::argument, "Anchor " + std::to_string(v) +
                                        " is no vertex of the target, which has " +
                                        std::to_string(target.vertex_count()) + ".");
    if (seen[v]++)
      throw Error(Status::argument,
                  "Vertex " + std::to_string(v) + " is named as an anchor more than once.");
  }
  return options.anchors;
}

}  // namespace

Similarity fitted_placement(const Mesh& source, const Mesh& target,
                            const Correspondence& correspondence) {
  const Eigen::VectorXd areas = triangle_areas(target);
  const Index count = static_cast<Index>(correspondence.source.size());
  Positions from(count, 3), to(count, 3);
  Eigen::VectorXd weights(count);
  for (int j = 0; j < correspondence.target_count(); ++j) {
    const int first = correspondence.begin[j], end = correspondence.begin[j + 1];
    for (int k = first; k < end; ++k) {
      from.row(k) = triangle_centre(source.positions, source.triangles, correspondence.source[k]);
      to.row(k) = triangle_centre(target.positions, target.triangles, j);
      weights[k] = areas[j] / (end - first);
    }
  }
  return fitted_stance(from, to, weights);
}

MeshTransfer::MeshTransfer(Mesh source, Mesh target, const Correspondence& correspondence,
                           const TransferOptions& options, const Progress& progress)
    : workers_(options.threads),
      source_(validated(std::move(source), "source")),
      target_(validated(std::move(target), "target")),
      anchor_(options.anchor),
      anchors_(checked_anchors(options, target_)) {
  if (correspondence.target_count() != target_.triangle_count())
    throw Error(Status::argument, "The correspondences are for " +
                                      std::to_string(correspondence.target_count()) +
                                      " triangles, and the target has " +
                                      std::to_string(target_.triangle_count()) + ".");
  report(progress, 0.05, "Comparing the meshes");
  placement_ =
      options.placement ? *options.placement : fitted_placement(source_, target_, correspondence);
  match(correspondence);
  prepare_source();
  report(progress, 0.1, "Building operators");
  factor(options, progress);
  report(progress, 0.95, "Finding loose parts");
  find_parts();
  gradients_.resize(static_cast<size_t>(target_.triangle_count()));
  displacement_ = result_ = Positions::Zero(target_.vertex_count(), 3);
  report(progress, 1.0, "Done");
}

MeshTransfer::~MeshTransfer() = default;

void MeshTransfer::match(const Correspondence& correspondence) {
  const int m = target_.triangle_count();
  std::vector<int> stand_in(static_cast<size_t>(m), -1);
  for (int j = 0; j < m; ++j) {
    matched_.push_back(correspondence.has_source(j));
    if (matched_[j])
      stand_in[j] = j;
    else if (unmatched_count++ == 0)
      unmatched_example = j;
  }
  if (unmatched_count == m)
    throw Error(Status::argument, "No triangle of the target corresponds to one of the source.");
  if (unmatched_count > 0) fill_from_neighbours(stand_in, target_.triangles);

  std::vector<int> number(static_cast<size_t>(source_.triangle_count()), -1);
  for (int triangle : correspondence.source) {
    if (number[triangle] < 0) {
      number[triangle] = static_cast<int>(used_.size());
      used_.push_back(triangle);
    }
    sources_.push_back(number[triangle]);
  }
  for (int j = 0; j < m; ++j) {
    const bool any = stand_in[j] >= 0;
    begin_.push_back(any ? correspondence.begin[stand_in[j]] : 0);
    end_.push_back(any ? correspondence.begin[stand_in[j] + 1] : 0);
  }
}

void MeshTransfer::prepare_source() {
  const GradientSources sources = gradient_sources(source_.positions, source_.triangles,
                                                   bounding_box_diagonal(source_.positions));
  source_stand_in_ = sources.of_triangle;
  RowOrder as_they_are;
  as_they_are.row_of_vertex.resize(static_cast<size_t>(source_.vertex_count()));
  std::iota(as_they_are.row_of_vertex.begin(), as_they_are.row_of_vertex.end(), 0);
  rotation_blocks_ =
      rotation_blocks<double>(source_.positions, source_.triangles, used_, sources, as_they_are);
  for (int triangle : used_) {
    stand_in_.push_back(sources.of_triangle[triangle]);
    rest_inverse_.push_back(
        stand_in_.back() < 0 ? Eigen::Matrix3d(Eigen::Matrix3d::Identity())
                             : Eigen::Matrix3d(edges_and_normal(source_.positions,
                                                                source_.triangles, stand_in_.back())
                                                   .inverse()));
  }
  source_gradients_.resize(used_.size());
  source_rows_ = Rows::Zero(source_.vertex_count(), 4);
  quaternions_ = Rows::Zero(kLanes * static_cast<Index>(rotation_blocks_.size()), 4);
}

void MeshTransfer::factor(const TransferOptions& options, const Progress& progress) {
  scale_ = bounding_box_diagonal(target_.positions);
  const Eigen::RowVector3d middle =
      0.5 * (target_.positions.colwise().maxCoeff() + target_.positions.colwise().minCoeff());
  const Mesh unit = {(target_.positions.rowwise() - middle) / scale_, target_.triangles};
  std::vector<int> roles(static_cast<size_t>(target_.vertex_count()), kFree);
  const bool pinned = anchor_ == Anchor::pinned;
  if (pinned)
    for (int v : anchors_) roles[v] = 0;
  if (std::find(roles.begin(), roles.end(), kFree) == roles.end())
    throw Error(Status::argument, "Every vertex is pinned, so nothing can follow: pin fewer.");
  region_ = split_region(unit, roles, pinned ? 1 : 0, MovedBy::base);

  const SurfaceOperators operators = surface_operators(unit.positions, unit.triangles);
  degenerate_ = operators.metric.degenerate;
  areas_ = operators.metric.areas;
  if (options.formulation == Formulation::surface) {
    SparseMatrix block = free_block(operators.laplacian, region_);
    unknowns_ = region_.free_count();
    nonzeros_ = static_cast<double>(block.nonZeros());
    const Dissection dissection = free_dissection(block, region_, unit.positions);
    BlockOptions how;
    how.dissection = &dissection;
    how.workers = &workers_;
    how.precision = options.precision;
    how.progress = within(progress, 0.2, 0.9);
    poisson_ = std::make_unique<PoissonSystem>(unit, region_, operators, std::move(block), how);
    flux_ = corner_divergence(operators.metric, unit.positions, unit.triangles);
    return;
  }
  std::vector<int> all(static_cast<size_t>(unit.triangle_count()));
  std::iota(all.begin(), all.end(), 0);
  tets_ = with_fourth_points(unit, all);
  roles = region_.role;
  for (int v : region_.grounds) roles[v] = kFixed;
  roles.resize(static_cast<size_t>(tets_.vertex_count()), kFree);
  volumetric_ =
      std::make_unique<TetPoisson>(tets_, roles, pinned ? 1 : 0, deformation_operator(tets_),
                                   options.formulation == Formulation::fourth_points
                                       ? volumes(tets_)
                                       : Eigen::VectorXd(Eigen::VectorXd::Ones(tets_.tet_count())),
                                   within(progress, 0.2, 0.9));
  unknowns_ = static_cast<int>(std::count(roles.begin(), roles.end(), kFree));
  nonzeros_ = static_cast<double>(volumetric_->laplacian().nonZeros());
}

void MeshTransfer::find_parts() {
  const Components components = connected_components(target_);
  std::vector<int> number(static_cast<size_t>(components.count), -1);
  for (int v = 0; v < target_.vertex_count(); ++v) {
    if (region_.role[v] == kFixed) continue;  // without a triangle
    int& part = number[components.of_vertex[v]];
    if (part < 0) {
      part = static_cast<int>(parts_.size());
      parts_.emplace_back();
    }
    parts_[part].vertices.push_back(v);
    parts_[part].pinned |= region_.role[v] >= 0;
  }
  for (int j = 0; j < target_.triangle_count(); ++j) {
    if (!matched_[j]) continue;
    Part& part = parts_[number[components.of_vertex[target_.triangles(j, 0)]]];
    part.triangles.push_back(j);
  }
  for (const Part& part : parts_)
    if (part.triangles.empty() && unmatched_part_count++ == 0)
      unmatched_part_example = part.vertices.front();
}

const Positions& MeshTransfer::apply(const Positions& pose, bool rotation_only,
                                     const Positions* places) {
  if (pose.rows() != source_.vertex_count())
    throw Error(Status::argument, "The pose has " + std::to_string(pose.rows()) +
                                      " vertices, and the source " +
                                      std::to_string(source_.vertex_count()) + ".");
  for (Index v = 0; v < pose.rows(); ++v)
    if (!pose.row(v).allFinite())
      throw Error(Status::argument, "Vertex " + std::to_string(v) + " of the pose is not finite.");
  Positions anchor_places(anchor_count(), 3);
  if (places && places->rows() != anchor_count())
    throw Error(Status::argument, "There are " + std::to_string(places->rows()) + " places for " +
                                      std::to_string(anchor_count()) + " anchors.");
  for (int i = 0; i < anchor_count(); ++i)
    anchor_places.row(i) = target_.positions.row(anchors_[i]);
  if (places) anchor_places = *places;
  if (!anchor_places.allFinite())
    throw Error(Status::argument, "The place of an anchor is not finite.");

  find_source_gradients(pose, rotation_only);
  workers_.over(target_.triangle_count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t j = begin; j < end; ++j)
      gradients_[j] = gradient(static_cast<int>(j), rotation_only);
  });
  displacement_.setZero();
  if (anchor_ == Anchor::pinned)
    for (int i = 0; i < anchor_count(); ++i)
      displacement_.row(anchors_[i]) =
          (anchor_places.row(i) - target_.positions.row(anchors_[i])) / scale_;
  if (poisson_)
    solve_on_surface();
  else
    solve_with_fourth_points();
  result_ = target_.positions + scale_ * displacement_;
  place(pose, anchor_places);
  if (!result_.allFinite())
    throw Error(Status::numeric,
                "The transferred pose is not finite: the source's pose is too large.");
  return result_;
}

void MeshTransfer::find_source_gradients(const Positions& pose, bool rotation_only) {
  if (rotation_only) {
    source_rows_.leftCols<3>() = pose;
    workers_.over(static_cast<int64_t>(rotation_blocks_.size()), kLeastRange / kLanes,
                  [&](int64_t begin, int64_t end) {
                    kernels().full.rotation_pass(
                        static_cast<int>(end - begin), rotation_blocks_.data() + begin,
                        source_rows_.data(), quaternions_.row(kLanes * begin).data());
                  });
    replace_collapsed(pose);
  }
  const Eigen::Quaterniond turn(placement_.rotation);
  workers_.over(static_cast<int64_t>(used_.size()), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) {
      if (rotation_only) {
        quaternions_.row(i) =
            (turn * quaternion(quaternions_, i) * turn.conjugate()).coeffs().transpose();
      } else if (stand_in_[i] < 0) {
        source_gradients_[i].setIdentity();
      } else {
        source_gradients_[i] = placement_.rotation *
                               edges_and_normal(pose, source_.triangles, stand_in_[i]) *
                               rest_inverse_[i] * placement_.rotation.transpose();
      }
    }
  });
}

void MeshTransfer::replace_collapsed(const Positions& pose) {
  const auto has_area = [&](int j) {
    const Eigen::Matrix3d e = edges_and_normal(pose, source_.triangles, j);
    const double longest = std::max(e.col(0).squaredNorm(), e.col(1).squaredNorm());
    return e.col(0).cross(e.col(1)).norm() > kCollapsed * longest;
  };
  std::vector<int> collapsed;
  for (size_t i = 0; i < used_.size(); ++i)
    if (stand_in_[i] >= 0 && !has_area(stand_in_[i])) collapsed.push_back(static_cast<int>(i));
  if (collapsed.empty()) return;
  std::vector<int> turning(source_stand_in_.size(), -1);
  for (int j = 0; j < source_.triangle_count(); ++j)
    if (source_stand_in_[j] == j && has_area(j)) turning[j] = j;
  fill_from_neighbours(turning, source_.triangles);
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

Eigen::Matrix3d MeshTransfer::gradient(int triangle, bool rotation_only) const {
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
  Eigen::Matrix3d sum = source_gradients_[sources_[begin]];
  for (int k = begin + 1; k < end; ++k) sum += source_gradients_[sources_[k]];
  return sum / (end - begin);
}

void MeshTransfer::solve_on_surface() {
  const RowOrder& order = poisson_->order();
  const ActiveTriangles& active = poisson_->active();
  Rows offsets = in_order(displacement_, order);
  const auto add = [&](int part, double* rows) {
    for (int i = active.begin[part]; i < active.begin[part + 1]; ++i) {
      const int j = active.triangles[i];
      const Eigen::Matrix3d turned = gradients_[j] * flux_.middleRows<3>(3 * Index(j)).transpose();
      for (int k = 0; k < 3; ++k)
        Eigen::Map<Eigen::Vector3d>(
            rows + 4 * Index(poisson_->target(part, target_.triangles(j, k)))) += turned.col(k);
    }
  };
  poisson_->solve(poisson_->rest_divergence(), add, offsets);
  for (int r = 0; r < order.free_count; ++r)
    displacement_.row(order.vertex_of_row[r]) = offsets.row(r).head<3>();
}

void MeshTransfer::solve_with_fourth_points() {
  const Index n = target_.vertex_count();
  Positions constrained = tets_.positions;
  constrained.topRows(n) += displacement_;
  RowMatrix gradients(3 * tets_.tet_count(), 3);
  for (int j = 0; j < tets_.tet_count(); ++j)
    gradients.middleRows<3>(3 * Index(j)) = gradients_[j].transpose();
  displacement_ = (volumetric_->solve(constrained, gradients) - tets_.positions).topRows(n);
}

void MeshTransfer::place(const Positions& pose, const Positions& anchor_places) {
  std::vector<Eigen::RowVector3d> missing;
  // What pinned parts miss of where their sources went, all others miss too.
  Eigen::RowVector3d of_pinned = Eigen::RowVector3d::Zero(), of_matched = of_pinned;
  double pinned_weight = 0, matched_weight = 0;
  for (const Part& part : parts_) {
    Eigen::Vector3d sum = Eigen::Vector3d::Zero();
    Eigen::Vector3d moved = Eigen::Vector3d::Zero();
    double of_part = 0;
    for (int j : part.triangles) {
      Eigen::Vector3d before = Eigen::Vector3d::Zero(), after = before;
      for (int k = begin_[j]; k < end_[j]; ++k) {
        const int source = used_[sources_[k]];
        before += triangle_centre(source_.positions, source_.triangles, source);
        after += triangle_centre(pose, source_.triangles, source);
      }
      const double count = end_[j] - begin_[j];
      const Eigen::Vector3d own = triangle_centre(target_.positions, target_.triangles, j);
      const Eigen::Matrix3d& S = gradients_[j];
      const Eigen::Vector3d wanted =
          placement_(after / count) + S * (own - placement_(before / count));
      const double change = (S - Eigen::Matrix3d::Identity()).squaredNorm();
      const double weight = areas_[j] / (kStill * kStill + change);
      sum += weight * (wanted - triangle_centre(result_, target_.triangles, j));
      moved += weight * (wanted - own);
      of_part += weight;
    }
    missing.push_back(of_part > 0 ? Eigen::RowVector3d(sum.transpose() / of_part)
                                  : Eigen::RowVector3d::Zero());
    if (part.pinned) {
      of_pinned += sum.transpose();
      pinned_weight += of_part;
    }
    of_matched += moved.transpose();
    matched_weight += of_part;
  }
  if (pinned_weight > 0) of_pinned /= pinned_weight;
  if (matched_weight > 0) of_matched /= matched_weight;

  for (size_t i = 0; i < parts_.size(); ++i) {
    if (parts_[i].pinned) continue;
    // A part without a source of its own goes along with the rest.
    const Eigen::RowVector3d shift =
        (parts_[i].triangles.empty() ? of_matched : missing[i]) - of_pinned;
    for (int v : parts_[i].vertices) result_.row(v) += shift;
  }
  if (anchor_ == Anchor::source || anchor_ == Anchor::pinned) return;

  Eigen::RowVector3d shift = Eigen::RowVector3d::Zero();
  if (anchor_ == Anchor::centroid) {
    for (int j = 0; j < target_.triangle_count(); ++j)
      shift += areas_[j] * (triangle_centre(target_.positions, target_.triangles, j) -
                            triangle_centre(result_, target_.triangles, j))
                               .transpose();
    shift /= areas_.sum();
  } else {
    int count = 0;
    for (int i = 0; i < anchor_count(); ++i) {
      if (region_.role[anchors_[i]] == kFixed) continue;  // without a triangle: it stays anyway
      shift += anchor_places.row(i) - result_.row(anchors_[i]);
      ++count;
    }
    shift /= std::max(count, 1);
  }
  for (const Part& part : parts_)
    for (int v : part.vertices) result_.row(v) += shift;
}

}  // namespace dd
