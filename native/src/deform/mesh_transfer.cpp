// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/mesh_transfer.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <string>
#include <utility>

#include "mesh/triangles.h"
#include "support/error.h"
#include "systems/free_block.h"
#include "transfer/component_places.h"
#include "transfer/followed_places.h"
#include "transfer/rigid_parts.h"

namespace dd {

namespace {

// Largest deviation of the sum of barycentric weights from 1, and of a weight below 0, in points
// that are given.
constexpr double kWeightTolerance = 1e-3;

Mesh validated(Mesh mesh, MeshOf which) {
  validate(mesh, which);
  return mesh;
}

std::vector<int> checked_anchors(const TransferOptions& options, const Mesh& target) {
  if (options.anchor == Anchor::source || options.anchor == Anchor::centroid) return {};
  if (options.anchors.empty())
    throw Error(Status::argument, "There is no anchor: name the vertices that stay in place",
                Remedy::call);
  std::vector<char> seen(static_cast<size_t>(target.vertex_count()), 0);
  for (int v : options.anchors) {
    if (v < 0 || v >= target.vertex_count())
      throw Error(Status::argument,
                  "Anchor " + std::to_string(v) + " is no vertex of the target, which has " +
                      std::to_string(target.vertex_count()),
                  Remedy::call);
    if (seen[v]++)
      throw Error(Status::argument, {Subject::target_vertex, v},
                  "is named as an anchor more than once", Remedy::call);
  }
  return options.anchors;
}

void check_points(const std::vector<PointOnTriangle>& points, const Mesh& source,
                  const Mesh& target) {
  if (points.empty()) return;
  if (points.size() != static_cast<size_t>(target.vertex_count()))
    throw Error(Status::argument,
                "There are points of " + std::to_string(points.size()) +
                    " vertices, and the target has " + std::to_string(target.vertex_count()),
                Remedy::call);
  for (size_t v = 0; v < points.size(); ++v) {
    const PointOnTriangle& point = points[v];
    if (point.triangle < -1 || point.triangle >= source.triangle_count())
      throw Error(Status::argument, {Subject::target_vertex, Index(v)},
                  "has its point in triangle " + std::to_string(point.triangle) +
                      ", and the source has " + std::to_string(source.triangle_count()),
                  Remedy::call);
    if (point.triangle >= 0 && !(std::abs(point.barycentric.sum() - 1) <= kWeightTolerance &&
                                 point.barycentric.minCoeff() >= -kWeightTolerance))
      throw Error(Status::argument, {Subject::target_vertex, Index(v)},
                  "has a point whose weights are negative or don't add up to 1", Remedy::call);
  }
}

}  // namespace

Similarity fitted_placement(const Mesh& source, const Mesh& target,
                            const Correspondence& correspondence) {
  const Eigen::VectorXd areas = triangle_areas(target.positions, target.triangles);
  const Positions of_source = triangle_normals(source.positions, source.triangles);
  const Positions of_target = triangle_normals(target.positions, target.triangles);
  const Index count = static_cast<Index>(correspondence.source.size());
  OrientedPoints from{Positions(count, 3), Positions(count, 3)}, to = from;
  Eigen::VectorXd weights(count);
  for (int j = 0; j < correspondence.target_count(); ++j) {
    const int first = correspondence.begin[j], end = correspondence.begin[j + 1];
    for (int k = first; k < end; ++k) {
      const int i = correspondence.source[k];
      from.positions.row(k) = triangle_centre(source.positions, source.triangles, i);
      from.normals.row(k) = of_source.row(i);
      to.positions.row(k) = triangle_centre(target.positions, target.triangles, j);
      to.normals.row(k) = of_target.row(j);
      weights[k] = areas[j] / (end - first);
    }
  }
  return fitted_placement(from, to, weights);
}

/// The source's gradients on the target's triangles, for both formulations.
struct MeshTransfer::OnTarget : GradientSource {
  explicit OnTarget(const SourceGradients& its_gradients) : gradients(its_gradients) {}

  void add(int section, double* rows) const override {
    flux->add(section, [&](int, int triangle) { return gradients.at(triangle); }, rows);
  }
  const Rows& at_rest() const override { return poisson->rest_divergence(); }
  Eigen::Matrix3d at(int triangle) const override { return gradients.at(triangle); }

  const SourceGradients& gradients;
  const PoissonSystem* poisson = nullptr;  // of (14)
  std::unique_ptr<CornerFlux> flux;
};

MeshTransfer::MeshTransfer(Mesh source, Mesh target, const Correspondence& correspondence,
                           const TransferOptions& options, const Progress& progress)
    : pool_(options.threads),
      source_(validated(std::move(source), MeshOf::source)),
      target_(validated(std::move(target), MeshOf::target)),
      anchor_(options.anchor),
      anchors_(checked_anchors(options, target_)),
      box_(target_.positions) {
  if (correspondence.target_count() != target_.triangle_count())
    throw Error(Status::argument,
                "The correspondences are for " + std::to_string(correspondence.target_count()) +
                    " triangles, and the target has " + std::to_string(target_.triangle_count()),
                Remedy::call);
  check_points(options.points, source_, target_);
  report(progress, 0.02, Stage::meshes);
  if (options.placement)
    placement_ = *options.placement;
  else if (!options.worn)
    placement_ = fitted_placement(source_, target_, correspondence);
  gradients_ = std::make_unique<SourceGradients>(source_, target_, correspondence, placement_);
  on_target_ = std::make_unique<OnTarget>(*gradients_);
  try {
    factor(options, within(progress, 0.2, 0.6));
  } catch (const Error& error) {
    throw error.of_target();
  }
  find_components();
  if (options.worn) worn_distance_ = options.worn->distance;
  add_corrections(options, within(progress, 0.6, 1));
  result_ = target_.positions;
  report(progress, 1.0, Stage::done);
}

MeshTransfer::~MeshTransfer() = default;

void MeshTransfer::factor(const TransferOptions& options, const Progress& progress) {
  const Mesh unit = {box_.into(target_.positions), target_.triangles};
  std::vector<int> roles(static_cast<size_t>(target_.vertex_count()), kFree);
  const bool pinned = anchor_ == Anchor::pinned;
  if (pinned)
    for (int v : anchors_) roles[v] = 0;
  if (std::find(roles.begin(), roles.end(), kFree) == roles.end())
    throw Error(Status::argument, "Every vertex is pinned, so nothing can follow",
                Remedy::pin_fewer);
  region_ = make_region(unit, roles, pinned ? 1 : 0, MovedBy::base);

  if (options.formulation == Formulation::surface) {
    surface_ = std::make_unique<FactoredSurface>(unit, region_);
    SparseMatrix block = free_block(surface_->operators.laplacian, region_);
    unknowns_ = region_.free_count();
    nonzeros_ = static_cast<double>(block.nonZeros());
    BlockOptions how;
    how.pool = &pool_;
    how.precision = options.precision;
    how.progress = progress;
    surface_->factor(std::move(block), how);
    on_target_->poisson = surface_->poisson.get();
    on_target_->flux = std::make_unique<CornerFlux>(*surface_);
    order_ = surface_->order();
    degenerate_ = surface_->operators.metric.degenerate;
    areas_ = surface_->operators.metric.areas;
  } else {
    std::vector<int> all(static_cast<size_t>(unit.triangle_count()));
    std::iota(all.begin(), all.end(), 0);
    fourth_points_ = std::make_unique<FourthPointSystem>(
        unit, region_, all,
        options.formulation == Formulation::fourth_points ? FourthPointWeights::volumes
                                                          : FourthPointWeights::ones,
        progress);
    unknowns_ = fourth_points_->unknowns();
    nonzeros_ = fourth_points_->nonzeros();
    std::vector<int> as_they_are(region_.free.size());
    std::iota(as_they_are.begin(), as_they_are.end(), 0);
    order_ = row_order(region_, as_they_are);
    const TriangleMetric metric = triangle_metric(unit.positions, unit.triangles);
    degenerate_ = metric.degenerate;
    areas_ = metric.areas;
  }
  offsets_ = Rows::Zero(order_.count(), 4);
}

void MeshTransfer::add_corrections(const TransferOptions& options, const Progress& progress) {
  const Placing placing = options.placing;
  need_whole_gradients_ = placing == Placing::vertices || placing == Placing::displacements;
  const bool is_worn = placing == Placing::vertices && options.worn;
  TransferContext context;
  context.source = &source_;
  context.target = &target_;
  context.box = &box_;
  context.placement = &placement_;
  context.gradients = gradients_.get();
  context.components = &components_;
  context.precision = options.precision;
  context.pool = &pool_;
  if (placing != Placing::components && !is_worn) {
    if (options.worn)
      points_ = std::make_unique<SourcePoints>(source_, options.worn->of_vertices);
    else
      points_ = std::make_unique<SourcePoints>(
          context, VertexTriangles(target_.triangles, target_.vertex_count()), options.points);
  }
  context.points = points_.get();
  const Displacements* displaced = nullptr;
  std::unique_ptr<PlaceCorrection> own;
  if (is_worn) {
    auto worn =
        std::make_unique<WornPlaces>(context, region_, *options.worn, options.gap, progress);
    worn_ = worn.get();
    own = std::move(worn);
  } else if (placing == Placing::vertices) {
    own = std::make_unique<FollowedPlaces>(context, progress);
  } else if (placing == Placing::parts) {
    own = std::make_unique<RigidParts>(context);
  } else if (placing == Placing::displacements) {
    auto displacements = std::make_unique<Displacements>(context);
    displaced = displacements.get();
    own = std::move(displacements);
  }
  auto components = std::make_unique<ComponentPlaces>(context, areas_, displaced);
  const ComponentPlaces& places = *components;
  corrections_.push_back(std::move(components));
  if (own) corrections_.push_back(std::move(own));
  // A garment stays on its source, even where a part of it is pinned.
  if (!is_worn) corrections_.push_back(std::make_unique<KeptTogether>(components_, places));
}

void MeshTransfer::find_components() {
  components_ = movable_components(target_, region_);
  for (Component& component : components_) {
    std::vector<int>& of = component.triangles;
    of.erase(
        std::remove_if(of.begin(), of.end(), [&](int j) { return !gradients_->is_matched(j); }),
        of.end());
    if (of.empty() && unmatched_component_count_++ == 0)
      unmatched_component_example_ = component.vertices.front();
  }
}

Positions MeshTransfer::checked_anchor_positions(const Positions* given_positions) const {
  if (given_positions && given_positions->rows() != anchor_count())
    throw Error(Status::argument,
                "There are " + std::to_string(given_positions->rows()) + " places for " +
                    std::to_string(anchor_count()) + " anchors",
                Remedy::call);
  Positions result(anchor_count(), 3);
  for (int i = 0; i < anchor_count(); ++i) result.row(i) = target_.positions.row(anchors_[i]);
  if (given_positions) result = *given_positions;
  if (!result.allFinite())
    throw Error(Status::argument, "The place of an anchor is not finite", Remedy::call);
  return result;
}

const Positions& MeshTransfer::apply(const Positions& pose, bool rotation_only,
                                     const Positions* given_positions) {
  if (pose.rows() != source_.vertex_count())
    throw Error(Status::argument,
                "The pose has " + std::to_string(pose.rows()) + " vertices, and the source " +
                    std::to_string(source_.vertex_count()),
                Remedy::call);
  if (rotation_only && need_whole_gradients_)
    throw Error(Status::argument, "Places by vertices or by displacements need whole gradients",
                Remedy::whole_gradients);
  if (!pose.allFinite())
    for (Index v = 0; v < pose.rows(); ++v)
      if (!pose.row(v).allFinite())
        throw Error(Status::argument, {Subject::source_vertex, v}, "is not finite in the pose",
                    Remedy::move_vertex);
  const Positions anchor_positions = checked_anchor_positions(given_positions);

  gradients_->set_pose(pose, rotation_only, pool_);
  solve(anchor_positions);
  for (const auto& correction : corrections_) correction->correct(pose, result_);
  keep_anchors(anchor_positions);
  if (!result_.allFinite())
    throw Error(Status::numeric,
                "The transferred pose is not finite: the source's pose is too large",
                Remedy::move_less);
  return result_;
}

void MeshTransfer::solve(const Positions& anchor_positions) {
  offsets_.setZero();
  if (anchor_ == Anchor::pinned)
    for (int i = 0; i < anchor_count(); ++i)
      offsets_.row(order_.row_of_vertex[anchors_[i]]).head<3>() =
          (anchor_positions.row(i) - target_.positions.row(anchors_[i])) / box_.scale;
  if (surface_)
    Reconstruction(*surface_).solve(*on_target_, Formulation::surface, offsets_);
  else
    fourth_points_->solve(*on_target_, order_, offsets_);
  pool_.parallel_for(order_.count(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (Index r = begin; r < end; ++r) {
      const int v = order_.vertex_of_row[size_t(r)];
      result_.row(v) = target_.positions.row(v) + box_.scale * offsets_.row(r).head<3>();
    }
  });
}

void MeshTransfer::keep_anchors(const Positions& anchor_positions) {
  if (anchor_ == Anchor::source || anchor_ == Anchor::pinned) return;
  const Eigen::RowVector3d shift = shift_to_anchor(anchor_positions);
  for (const Component& component : components_)
    for (int v : component.vertices) result_.row(v) += shift;
}

Eigen::RowVector3d MeshTransfer::shift_to_anchor(const Positions& anchor_positions) const {
  MeanShift missing;
  if (anchor_ == Anchor::centroid) {
    for (int j = 0; j < target_.triangle_count(); ++j)
      missing.add(areas_[j], (triangle_centre(target_.positions, target_.triangles, j) -
                              triangle_centre(result_, target_.triangles, j))
                                 .transpose());
  } else {
    for (int i = 0; i < anchor_count(); ++i)
      if (region_.role[anchors_[i]] != kFixed)  // fixed here: without a triangle, at rest
        missing.add(1, anchor_positions.row(i) - result_.row(anchors_[i]));
  }
  return missing.mean();
}

}  // namespace dd
