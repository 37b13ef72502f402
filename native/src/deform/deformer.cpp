// SPDX-License-Identifier: GPL-3.0-or-later
#include "deform/deformer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/carried_components.h"

namespace dd {

namespace {

// Largest distance of a free handle's pivot from its centre, in diagonals of the box. Safety: about
// a farther point the smallest rotation that the surface asks for swings the handle away.
constexpr double kMaxPivotDistance = 1e4;

void validate_example(const Positions& example, int number, const Mesh& mesh) {
  const Subject subject{Subject::example, number};
  if (example.rows() != mesh.vertex_count())
    throw Error(Status::argument, subject,
                "has " + std::to_string(example.rows()) + " vertices, the mesh " +
                    std::to_string(mesh.vertex_count()),
                Remedy::same_vertices);
  if (std::vector<int> lost = vertices_with_bad_coordinates(example); !lost.empty()) {
    const std::string first = std::to_string(lost.front());
    throw Error(Status::argument, subject,
                "has a coordinate, of vertex " + first +
                    ", that is not finite or too far away to compute with",
                Remedy::move_vertex, std::move(lost));
  }
}

Mesh validated(Mesh mesh) {
  validate(mesh);
  return mesh;
}

/// Whether what the options ask for reads no more of the mesh than a MeshPart has.
bool may_bind_part(const BindOptions& options) {
  return options.base.size() == 0 && options.examples.empty() && options.metric_smoothing == 0;
}

}  // namespace

BindOptions without_surfaces(const BindOptions& options) {
  BindOptions result;
  result.base_metric = options.base_metric;
  result.metric_smoothing = options.metric_smoothing;
  result.smoothness = options.smoothness;
  result.triangulation = options.triangulation;
  result.stiffness = options.stiffness;
  result.precision = options.precision;
  result.threads = options.threads;
  return result;
}

template <class Work>
auto Deformer::of_bound(const Work& work) {
  try {
    return work();
  } catch (const Error& error) {
    if (!part_) throw;
    throw part_->of_whole(error);
  }
}

Deformer::Deformer(Mesh mesh, const std::vector<int>& roles, int handle_count,
                   const BindOptions& options, const Progress& progress)
    : pool_(options.threads),
      bind_options_(without_surfaces(options)),
      mesh_(validated(std::move(mesh))),
      region_(make_region(mesh_, roles, handle_count,
                          options.base.size() ? MovedBy::base : MovedBy::handles)) {
  report(progress, 0.02, Stage::operators);
  box_ = UnitBox(mesh_.positions);
  BindOptions in_unit = options;
  if (options.base_triangles.size()) {
    Mesh proxy{options.base, options.base_triangles};
    validate(proxy, MeshOf::base);
    proxy.positions = box_.into(proxy.positions);
    proxy_ = std::make_unique<BaseProxy>(Mesh{box_.into(mesh_.positions), mesh_.triangles},
                                         std::move(proxy));
    in_unit.base = box_.into(mesh_.positions);  // at rest BaseProxy carries S to itself
  } else {
    if (options.base.size() && options.base.rows() != mesh_.vertex_count())
      throw Error(Status::argument,
                  "The base has " + std::to_string(options.base.rows()) + " vertices, the mesh " +
                      std::to_string(mesh_.vertex_count()),
                  Remedy::same_vertices);
    in_unit.base = box_.into(options.base);
  }
  for (size_t i = 0; i < options.examples.size(); ++i) {
    validate_example(options.examples[i], static_cast<int>(i), mesh_);
    in_unit.examples[i] = box_.into(options.examples[i]);
  }
  bind(in_unit, progress);
  degenerate_ = bound_->operators.metric.degenerate;
  if (part_)
    for (int& j : degenerate_) j = part_->triangles[size_t(j)];
  if (!region_.grounds.empty()) carried_ = std::make_unique<CarriedComponents>(*bound_);

  coefficients_ = RowMatrix::Zero(4 * handle_count, 4);
  linear_.assign(static_cast<size_t>(handle_count), Eigen::Matrix3d::Identity());
  base_ = bound_->rest_base;
  moved_ = Rows::Zero(base_.rows(), 4);
  report(progress, 1.0, Stage::done);
}

void Deformer::bind(const BindOptions& in_unit, const Progress& progress) {
  Mesh in_box{box_.into(mesh_.positions), mesh_.triangles};
  if (may_bind_part(in_unit)) part_ = MeshPart::make(in_box, region_, in_unit.largest_part);
  if (!part_) {
    bound_ = std::make_unique<BoundSurface>(std::move(in_box), region_, in_unit, pool_, progress);
    return;
  }
  in_box = {};
  BindOptions of_part = in_unit;
  if (in_unit.stiffness.size()) of_part.stiffness = in_unit.stiffness(part_->vertices).eval();
  of_bound([&] {
    bound_ = std::make_unique<BoundSurface>(std::move(part_->mesh), part_->region, of_part, pool_,
                                            progress);
  });
  part_->mesh = {};
  bound_->whole = part_->whole;
}

Deformer::~Deformer() = default;

const Positions& Deformer::update(const double* matrices, const UpdateOptions& options,
                                  const Positions* deformed_base) {
  move(matrices, options, deformed_base);
  if (offsets_.rows() == 0) offsets_ = Positions::Zero(mesh_.vertex_count(), 3);
  scale_to_mesh(moved_, offsets_);
  return offsets_;
}

void Deformer::update_to(float* out, Index stride, bool positions, const double* matrices,
                         const UpdateOptions& options, const Positions* deformed_base) {
  move(matrices, options, deformed_base);
  require_floats();
  if (part_)
    pool_.parallel_for(mesh_.vertex_count(), kLeastRange, [&](int64_t begin, int64_t end) {
      for (int64_t v = begin; v < end; ++v)
        for (int c = 0; c < 3; ++c)
          out[stride * v + c] = positions ? static_cast<float>(mesh_.positions(v, c)) : 0;
    });
  pool_.parallel_for(moved_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    for (int64_t r = begin; r < end; ++r) {
      const int v = vertex_of(r);
      for (int c = 0; c < 3; ++c) {
        const double offset = box_.scale * moved_(r, c);
        const double value = positions ? mesh_.positions(v, c) + offset : offset;
        out[stride * v + c] = static_cast<float>(value);
      }
    }
  });
}

void Deformer::require_floats() {
  // Half of the range, so that the sum with a position, which is at most kMaxCoordinate, stays
  // within it.
  constexpr double kMaxFloat = 0.5 * std::numeric_limits<float>::max();
  std::atomic<bool> fits{true};
  pool_.parallel_for(moved_.rows(), kLeastRange, [&](int64_t begin, int64_t end) {
    const auto rows = moved_.middleRows(begin, end - begin);
    // The sum of absolute values bounds each of them and is NaN if one is. Only where it is too
    // large each value is tested.
    if (box_.scale * rows.cwiseAbs().sum() < kMaxFloat) return;
    if (!(box_.scale * rows.leftCols<3>().array().abs() < kMaxFloat).all()) fits = false;
  });
  if (fits) return;
  if (outside_base() || region_.handle_count == 0) throw leaves_single_precision();
  // Names the handle with the largest motion.
  int farthest = 0;
  double most = -1;
  for (int h = 0; h < region_.handle_count; ++h) {
    const double moves = coefficients_.middleRows(4 * h, 4).cwiseAbs().maxCoeff();
    if (moves > most) {
      most = moves;
      farthest = h;
    }
  }
  throw Error(Status::numeric, {Subject::handle, farthest},
              "is moved so far that the deformed surface leaves the range of single precision",
              Remedy::move_less);
}

void Deformer::move(const double* matrices, const UpdateOptions& options,
                    const Positions* deformed_base) {
  of_bound([&] { move_bound(matrices, options, deformed_base); });
}

void Deformer::move_bound(const double* matrices, const UpdateOptions& options,
                          const Positions* deformed_base) {
  take_matrices(matrices);
  if (outside_base()) take_base(deformed_base);
  std::vector<double> turns = options.turns;
  rotate_free_handles(options, turns);
  const RowOrder& order = bound_->order();
  for (int r = order.free_count; r < order.fixed_begin; ++r) {
    const int h = region_.role[size_t(vertex_of(r))];
    const Eigen::RowVector3d arm =
        bound_->rest.row(r).head<3>() - bound_->coordinates.centres().row(h);
    moved_.row(r) = arm * coefficients_.middleRows<3>(4 * h) + coefficients_.row(4 * h + 3);
  }
  moved_.bottomRows(order.count() - order.fixed_begin).setZero();
  MotionBlend* const motions = outside_base() ? nullptr : &blend(options.base_deformer, turns);
  if (motions) move_base(*motions, options.base_deformer);
  if (options.output == Output::base) {
    moved_ = base_ - bound_->rest;
    if (motions) show_limbs(*motions, options);
    return;
  }
  const bool carried = facts(options.method).from_base;
  Method& method = this->method(options.method, options.of_method.progress);
  Turning turning;
  if (!motions)
    turning.propagate_signs = true;
  else if (options.method == MethodKind::detail && options.of_method.rotation_only)
    turning = motions->turning(options.base_deformer);
  method.update({coefficients_, linear_, base_, turning, options.free, moved_}, options.of_method);
  if (carried && carried_) carried_->place(base_, moved_);
}

void Deformer::show_limbs(MotionBlend& motions, const UpdateOptions& options) {
  if (options.method != MethodKind::detail) return;
  Method& by = method(options.method, options.of_method.progress);
  if (by.is_solid(options.of_method))
    by.show_limbs({base_, linear_}, motions.turning(options.base_deformer), options.of_method,
                  moved_);
}

std::vector<MotionBlend::Affine> Deformer::motions() const {
  std::vector<MotionBlend::Affine> motions;
  for (int h = 0; h < region_.handle_count; ++h) {
    // About the handle's centre o in the unit box: x ↦ o + A (x − o) + d, d the displacement of o.
    const Eigen::Vector3d own = bound_->coordinates.centres().row(h);
    MotionBlend::Affine motion;
    motion << linear_[h],
        own - linear_[h] * own + coefficients_.row(4 * h + 3).head<3>().transpose();
    motions.push_back(motion);
  }
  return motions;
}

void Deformer::rotate_free_handles(const UpdateOptions& options, std::vector<double>& turns) {
  const std::vector<char>& free = options.free;
  if (std::find(free.begin(), free.end(), 1) == free.end()) return;
  const Positions pivots =
      options.pivots.size() ? box_.into(options.pivots) : bound_->coordinates.centres();
  for (int h = 0; h < region_.handle_count; ++h)
    if (free[h] &&
        !((pivots.row(h) - bound_->coordinates.centres().row(h)).norm() < kMaxPivotDistance))
      throw Error(Status::argument, {Subject::handle, h},
                  "has a pivot too far from its vertices to turn about: put it among them",
                  Remedy::call);
  std::vector<MotionBlend::Affine> motions = this->motions();
  if (options.method == MethodKind::examples) {
    // This method finds the rotations itself.
    for (int h = 0; h < region_.handle_count; ++h) {
      if (!free[h]) continue;
      const Eigen::Vector3d pivot = pivots.row(h);
      motions[h].col(3) += motions[h].leftCols<3>() * pivot - pivot;
      motions[h].leftCols<3>().setIdentity();
    }
  } else {
    find_free_rotations(options, pivots, motions, turns);
  }
  for (int h = 0; h < region_.handle_count; ++h) {
    if (!free[h]) continue;
    linear_[h] = motions[h].leftCols<3>();
    const Eigen::Matrix3d change = linear_[h] - Eigen::Matrix3d::Identity();
    const Eigen::Vector3d centre = bound_->coordinates.centres().row(h);
    coefficients_.block<3, 3>(4 * h, 0) = change.transpose();
    coefficients_.block<1, 3>(4 * h + 3, 0) = (change * centre + motions[h].col(3)).transpose();
  }
}

void Deformer::find_free_rotations(const UpdateOptions& options, const Positions& pivots,
                                   std::vector<MotionBlend::Affine>& motions,
                                   std::vector<double>& turns) {
  Method& by = method(options.method, options.of_method.progress);
  const bool solid = !outside_base() && by.is_solid(options.of_method);
  if (!free_turns_ || free_turns_->free() != options.free || free_turns_solid_ != solid) {
    free_turns_ = std::make_unique<FreeTurns>(
        *bound_, options.free, solid ? by.limbs(options.of_method) : Eigen::VectorXd());
    free_turns_solid_ = solid;
  }
  if (outside_base())
    free_turns_->follow(base_, motions, pivots);
  else
    free_turns_->find(motions, pivots, turns);
}

std::vector<double> Deformer::completed_matrices(const double* matrices,
                                                 const UpdateOptions& options,
                                                 std::vector<double>& turns) {
  take_matrices(matrices);
  turns = options.turns;
  rotate_free_handles(options, turns);
  std::vector<double> result(matrices, matrices + 12 * Index(region_.handle_count));
  const std::vector<MotionBlend::Affine> motions = this->motions();
  for (size_t h = 0; h < options.free.size(); ++h) {
    if (!options.free[h]) continue;
    const Eigen::Vector3d centre = box_.centre;
    Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(result.data() + 12 * h);
    matrix.leftCols<3>() = motions[h].leftCols<3>();
    matrix.col(3) = box_.scale * motions[h].col(3) + centre - motions[h].leftCols<3>() * centre;
  }
  return result;
}

MotionBlend& Deformer::blend(BaseDeformer deformer, const std::vector<double>& turns) {
  if (!motions_) motions_ = std::make_unique<MotionBlend>(*bound_);
  // The linear base ignores whole turns.
  motions_->set_pose(motions(), deformer == BaseDeformer::linear ? std::vector<double>{} : turns);
  return *motions_;
}

void Deformer::take_base(const Positions* deformed) {
  if (!deformed || deformed->rows() != base_vertex_count())
    throw Error(Status::argument,
                "This surface was bound to a base from outside, and the update "
                "has no deformed base with as many vertices",
                Remedy::call);
  if (!deformed->allFinite())
    throw Error(Status::argument, "The deformed base has coordinates that are not finite",
                Remedy::move_vertex);
  const Positions base = box_.into(*deformed);
  base_ = in_order(proxy_ ? proxy_->carry(base, pool_) : base, bound_->order());
}

void Deformer::move_base(MotionBlend& motions, BaseDeformer deformer) {
  const RowOrder& order = bound_->order();
  bound_->extension.displace(coefficients_, bound_->rest_base, base_);
  const double fraction = motions.blend_fraction(deformer);
  if (fraction > 0) motions.blend_into(moved_, fraction, base_);
  const int held = order.fixed_begin - order.free_count;
  base_.middleRows(order.free_count, held) = bound_->rest_base.middleRows(order.free_count, held) +
                                             moved_.middleRows(order.free_count, held);
}

void Deformer::take_matrices(const double* matrices) {
  using Affine = Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>>;
  for (int h = 0; h < region_.handle_count; ++h) {
    const Affine matrix(matrices + 12 * static_cast<Index>(h));
    if (!matrix.allFinite())
      throw Error(Status::argument, {Subject::handle, h}, "has a matrix that is not finite",
                  Remedy::call);
    linear_[h] = matrix.leftCols<3>();
    const Eigen::Matrix3d change = linear_[h] - Eigen::Matrix3d::Identity();
    const Eigen::RowVector3d centre =
        box_.scale * bound_->coordinates.centres().row(h) + box_.centre;
    const Eigen::Vector3d shift = change * centre.transpose() + matrix.col(3);
    coefficients_.block<3, 3>(4 * h, 0) = change.transpose();
    coefficients_.block<1, 3>(4 * h + 3, 0) = shift.transpose() / box_.scale;
  }
}

Method& Deformer::method(MethodKind kind, const Progress& progress) {
  std::unique_ptr<Method>& made = methods_[static_cast<size_t>(kind)];
  if (!made) made = facts(kind).make(*bound_, progress);
  return *made;
}

void Deformer::scale_to_mesh(const Rows& rows, Positions& vectors) const {
  double sum = 0;
  for (Index r = 0; r < rows.rows(); ++r) {
    for (int c = 0; c < 3; ++c) vectors(vertex_of(r), c) = box_.scale * rows(r, c);
    sum += std::abs(rows(r, 0)) + std::abs(rows(r, 1)) + std::abs(rows(r, 2));
  }
  if (!std::isfinite(sum))
    throw Error(Status::numeric,
                "The handles' matrices are too large: the deformed surface is not finite",
                Remedy::move_less);
}

Positions Deformer::positions_in_mesh(const Rows& rows) const {
  Positions positions = mesh_.positions.rowwise() - box_.centre;
  scale_to_mesh(rows, positions);
  return positions.rowwise() + box_.centre;
}

Positions Deformer::base() const { return positions_in_mesh(bound_->rest_base); }

Positions Deformer::deformed_base() const { return positions_in_mesh(base_); }

MethodFindings Deformer::findings(MethodKind kind) const {
  const std::unique_ptr<Method>& made = methods_[static_cast<size_t>(kind)];
  if (made) {
    MethodFindings found = made->findings();
    if (part_)
      for (int& v : found.unrepresented) v = part_->vertices[size_t(v)];
    return found;
  }
  MethodFindings none;
  none.example_weights.assign(bound_->examples.size(), 0.0);
  return none;
}

double Deformer::bytes() const {
  const auto doubles = mesh_.positions.size() + offsets_.size() + coefficients_.size() +
                       base_.size() + moved_.size();
  const auto ints = mesh_.triangles.size() +
                    static_cast<Index>(region_.role.size() + region_.row.size() +
                                       region_.free.size() + region_.handle_vertices.size());
  double sum = static_cast<double>(doubles) * sizeof(double) +
               static_cast<double>(ints) * sizeof(int) + bound_->bytes() +
               (part_ ? part_->bytes() : 0) + (motions_ ? motions_->bytes() : 0) +
               (free_turns_ ? free_turns_->bytes() : 0) + (proxy_ ? proxy_->bytes() : 0);
  for (const auto& made : methods_)
    if (made) sum += made->bytes();
  return sum;
}

}  // namespace dd
