// SPDX-License-Identifier: GPL-3.0-or-later
#include "surfaces.h"

#include <Eigen/Geometry>

namespace dd::fuzz {

namespace {

using Matrix = Eigen::Matrix<double, 3, 4, Eigen::RowMajor>;

Eigen::Vector3d point(const std::vector<float>& positions, size_t v) {
  return {positions[3 * v], positions[3 * v + 1], positions[3 * v + 2]};
}

Eigen::Vector3d any_direction(Bytes& bytes) {
  return Eigen::Vector3d(bytes.between(-1, 1), bytes.between(-1, 1), bytes.between(0.1, 1))
      .normalized();
}

/// size: of the mesh. centre: of the handle's turn.
Matrix any_matrix(Bytes& bytes, double size, const Eigen::Vector3d& centre) {
  Eigen::Matrix3d linear = Eigen::Matrix3d::Identity();
  Eigen::Vector3d shift = Eigen::Vector3d::Zero();
  const int kind = bytes.below(10);
  if (kind >= 1) shift = size * bytes.between(0, 1) * any_direction(bytes);
  if (kind >= 2) linear = Eigen::AngleAxisd(bytes.between(-3.2, 3.2), any_direction(bytes));
  if (kind == 6) linear *= bytes.between(0.2, 3);
  if (kind == 7)
    for (int k = 0; k < 9; ++k) linear(k / 3, k % 3) += bytes.between(-0.5, 0.5);
  if (kind == 8) linear.col(bytes.below(3)) *= -1;          // mirrored
  if (kind == 9) linear.leftCols(1 + bytes.below(3)) *= 0;  // of rank 2, 1 or 0
  Matrix matrix;
  matrix << linear, centre - linear * centre + shift;
  if (bytes.odd()) matrix *= std::pow(10, bytes.below(40));
  if (bytes.odd()) matrix(bytes.below(3), bytes.below(4)) = bytes.any();
  return matrix;
}

/// The mean of the vertices with that role; 0 where there are none.
Eigen::Vector3d centre_of(const Surface& surface, int32_t role) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  size_t count = 0;
  for (size_t v = 0; v < surface.vertex_count(); ++v)
    if (surface.roles[v] == role) {
      sum += point(surface.positions, v);
      ++count;
    }
  return count ? Eigen::Vector3d(sum / double(count)) : sum;
}

bool invertible(const Matrix& matrix) {
  const Eigen::Matrix3d linear = matrix.leftCols<3>();
  return linear.determinant() > 1e-6 * std::pow(linear.norm(), 3);
}

/// Of the vertices, or mostly empty. Read aside.
std::vector<float> any_stiffness(const Surface& surface, Bytes& bytes) {
  const int kind = bytes.aside(8);
  if (kind < 6) return {};
  const int steps = 1 + bytes.aside(8);
  std::vector<float> weights;
  for (size_t v = 0; v < surface.vertex_count(); ++v)
    weights.push_back(kind == 6 ? float(v % size_t(steps + 1)) / float(steps)
                                : float(8 * v < size_t(steps) * surface.vertex_count()));
  if (!bytes.tame() && bytes.aside(8) == 7) weights.push_back(1);  // one too many
  if (!bytes.tame() && !weights.empty() && bytes.aside(8) == 7)
    weights.front() = bytes.aside(2) ? 2.0f : std::numeric_limits<float>::quiet_NaN();
  return weights;
}

}  // namespace

Bind any_bind(Bytes& bytes) {
  Bind bind;
  bind.surface = any_surface(bytes);
  const Surface& surface = bind.surface;
  bind.tame = bytes.tame() && surface.sound;
  dd_bind_options& options = bind.options;
  options = usual<dd_bind_options>();
  options.base_metric = bytes.choice(DD_METRIC_BASE);
  // The base of a sound surface may collapse, and can't be measured on then.
  bind.tame = bind.tame && options.base_metric == DD_METRIC_SURFACE;
  if (bytes.one_in(3)) options.metric_smoothing = bytes.number(0, 4);
  options.smoothness = bytes.choice(DD_SMOOTHNESS_MEMBRANE, DD_SMOOTHNESS_CURVATURE_VARIATION);
  options.precision = bytes.choice(DD_PRECISION_DOUBLE);
  options.threads = bytes.one_in(4) ? bytes.choice(1, 3) : 1;
  options.triangulation = bytes.choice(DD_TRIANGULATION_GIVEN);
  switch (bytes.below(6)) {
    case 4:
      bind.base = Points(posed(surface.positions, bytes), bytes);
      break;
    case 5: {
      Surface cage = any_surface(bytes);
      bind.tame = bind.tame && cage.sound;
      bind.base = Points(std::move(cage.positions), bytes);
      bind.base_triangles = std::move(cage.triangles);
      break;
    }
    default:
      break;
  }
  options.base = bytes.pointer(bind.base.given());
  options.base_triangles =
      bytes.pointer(bind.base_triangles.empty() ? nullptr : bind.base_triangles.data());
  options.base_triangle_count = bind.base_triangles.size() / 3;
  if (bind.base.given() && bytes.odd()) bind.surface.handle_count = 0;
  if (bytes.one_in(3)) {
    const int count = 1 + bytes.below(3);
    for (int k = 0; k < count; ++k)
      bind.examples.emplace_back(posed(surface.positions, bytes), bytes);
    for (const Points& example : bind.examples)
      bind.given_examples.push_back(counted(*example.given(), bytes));
    bind.given_examples.shrink_to_fit();  // sanitizers see reads beyond the end
    options.examples = bytes.pointer(bind.given_examples.data());
    options.example_count = bind.given_examples.size();
  }
  bind.stiffness = any_stiffness(surface, bytes);
  if (!bind.stiffness.empty()) {
    options.stiffness = bind.stiffness.data();
    options.stiffness_count = bind.stiffness.size();
  }
  if (!bytes.odd(32)) bind.given = std::make_shared<Sized<dd_bind_options>>(options, bytes);
  options = bind.given ? bind.given->known() : usual<dd_bind_options>();
  bind.wrong = (bind.given && bind.given->wrong()) || (options.base && bind.base.misplaced());
  if (options.examples)
    for (size_t k = 0; k < std::min(options.example_count, bind.examples.size()); ++k)
      bind.wrong = bind.wrong || misplaced(options.examples[k]);
  return bind;
}

dd_status Bind::start(dd_job** job, Bytes& bytes) const {
  const GivenMesh mesh(surface, bytes);
  const dd_status status =
      dd_deformer_bind_start(bytes.pointer(mesh.get()), bytes.pointer(surface.roles.data()),
                             bytes.count(surface.roles.size()), surface.handle_count,
                             given ? given->get() : nullptr, bytes.pointer(job));
  promise(status != DD_OK || !(wrong || mesh.misplaced()),
          "a bind with a stride or a struct_size that is none is refused");
  return status;
}

Owned<dd_deformer> Bind::made(int32_t threads) const {
  const dd_mesh mesh = surface.mesh();
  const dd_points packed_base = base.packed();
  std::vector<dd_points> packed_examples;
  for (const Points& example : examples) packed_examples.push_back(example.packed());
  dd_bind_options how = options;
  how.struct_size = sizeof how;
  how.threads = threads;
  if (how.base) how.base = &packed_base;
  if (how.examples) how.examples = packed_examples.data();
  dd_job* job = nullptr;
  dd_deformer* deformer = nullptr;
  if (well(dd_deformer_bind_start(&mesh, surface.roles.data(), surface.roles.size(),
                                  surface.handle_count, &how, &job)))
    well(dd_job_take_deformer(job, &deformer));
  dd_job_free(job);
  return Owned<dd_deformer>(deformer);
}

namespace {

/// Settings of one method as they are passed, or null for the defaults.
template <class Options>
const Options* given_as(const Options& options, std::optional<Sized<Options>>& held, Bytes& bytes) {
  held.emplace(options, bytes);
  return bytes.aside(8) == 7 ? nullptr : held->get();
}

dd_refinement_options any_refinement(Bytes& bytes) {
  auto options = usual<dd_refinement_options>();
  options.iterations = bytes.one_in(2) ? bytes.choice(5) : 0;
  // An invalid number must be beyond the limit: any smaller one would take long.
  if (options.iterations > 10) options.iterations = 20000;
  if (const int kind = bytes.aside(8); kind >= 5) {
    const double solidities[] = {0, 0.4, bytes.tame() ? 1 : 1.5};
    options.solidity = solidities[kind - 5];
  }
  return options;
}

}  // namespace

Motion any_motion(const Bind& bind, Bytes& bytes) {
  Motion motion;
  const Surface& surface = bind.surface;
  const auto handles = static_cast<size_t>(std::max(0, surface.handle_count));
  const double size = std::min(1e30, extent(surface.positions));
  dd_update_options& options = motion.options;
  options = usual<dd_update_options>();
  options.method = bytes.choice(DD_METHOD_EXAMPLES);
  options.gradients = bytes.choice(DD_GRADIENTS_WHOLE);
  dd_refinement_options refinement = any_refinement(bytes);
  options.output = bytes.one_in(6) ? bytes.choice(DD_OUTPUT_BASE) : DD_OUTPUT_RESULT;
  options.values = bytes.choice(DD_VALUES_OFFSETS);
  auto normal = usual<dd_normal_options>();
  normal.levels = bytes.choice(1, 4);
  if (bytes.one_in(4)) options.formulation = bytes.choice(DD_FORMULATION_FOURTH_POINTS_UNWEIGHTED);
  auto volumes = usual<dd_volumes_options>();
  if (bytes.one_in(4)) volumes.tolerance = bytes.number(0, 1);
  volumes.iterations = std::min(4, bytes.choice(4));
  options.steps = bytes.one_in(6) ? bytes.choice(1, 3) : 1;
  if (options.steps > 3) options.steps = 1001;
  if (bytes.one_in(3))
    refinement.rim_smoothing = bytes.number(0, 1);
  else if (!bytes.flag())
    refinement.rim_smoothing = 0;
  if (bytes.one_in(3)) refinement.rotation_smoothing = bytes.number(0, 1);
  options.base_deformer = bytes.choice(DD_BASE_DEFORMER_MOTIONS);
  auto examples = usual<dd_examples_options>();
  if (bytes.one_in(4)) examples.stiffness = bytes.number(0, 4);
  const bool known = surface.vertex_count() > 0 && std::isfinite(size);
  bool whole = true;
  for (size_t h = 0; h < handles; ++h) {
    Matrix matrix;
    const Eigen::Vector3d centre = known ? centre_of(surface, int32_t(h)) : Eigen::Vector3d::Zero();
    // Now and then two handles move alike.
    if (h > 0 && bytes.one_in(8))
      std::copy_n(motion.matrices.end() - 12, 12, matrix.data());
    else
      matrix = any_matrix(bytes, size, centre);
    whole = whole && invertible(matrix);
    motion.matrices.insert(motion.matrices.end(), matrix.data(), matrix.data() + 12);
    if (h == 0 ? bytes.one_in(5) : !motion.turns.empty())
      for (int c = 0; c < 3; ++c) motion.turns.push_back(bytes.number(-15, 15));
    if (h == 0 ? bytes.flag() : !motion.handle_turns.empty())
      motion.handle_turns.push_back(bytes.choice(DD_HANDLE_TURNS_FREE));
    if (h == 0 ? bytes.one_in(5) : !motion.pivots.empty())
      for (int c = 0; c < 3; ++c) motion.pivots.push_back(centre[c] + size * bytes.number(-1, 1));
  }
  motion.matrices = std::vector<double>(motion.matrices);
  if (bind.options.base) {
    motion.base = Points(posed(bind.base.values(), bytes), bytes);
    *motion.base.given() = counted(*motion.base.given(), bytes);
    options.base = bytes.pointer(motion.base.given());
  }
  if (bind.options.example_count > 0 && bytes.one_in(3)) {
    for (size_t k = 0; k < bind.options.example_count; ++k)
      motion.weights.push_back(bytes.number(-0.5, 1.5));
    examples.weights = bytes.pointer(motion.weights.data());
    examples.weight_count = motion.weights.size();
  }
  const auto give = [&](const auto& values, auto*& array, size_t& count) {
    if (values.empty()) return;
    array = bytes.pointer(values.data());
    count = bytes.count(handles);
  };
  give(motion.turns, options.turns, options.turn_count);
  give(motion.handle_turns, options.handle_turns, options.handle_turn_count);
  give(motion.pivots, options.pivots, options.pivot_count);
  if (bind.options.example_count > 0 && bytes.one_in(3)) {
    for (size_t k = 0; k < 2 * bind.options.example_count; ++k)
      motion.limits.push_back(k % 2 == 0 ? bytes.number(-1, 0) : bytes.number(0, 1));
    examples.limits = bytes.pointer(motion.limits.data());
    examples.limit_count = bind.options.example_count;
  }
  motion.endless = bytes.odd(64);
  if (motion.endless) {
    volumes.iterations = std::numeric_limits<int32_t>::max();
    volumes.tolerance = 1e-300;
    options.steps = 1000;
  }
  options.refinement = given_as(refinement, motion.refinement, bytes);
  options.normal = given_as(normal, motion.normal, bytes);
  options.volumes = given_as(volumes, motion.volumes, bytes);
  options.examples = given_as(examples, motion.examples, bytes);
  if (!bytes.odd(32)) motion.given = std::make_shared<Sized<dd_update_options>>(options, bytes);
  options = motion.given ? motion.given->known() : usual<dd_update_options>();
  const bool by_examples = options.method == DD_METHOD_EXAMPLES;
  motion.tame = bind.tame && (options.steps <= 1 || (whole && !bind.options.base && !by_examples));
  motion.wrong =
      (motion.given && motion.given->wrong()) || (options.base && motion.base.misplaced()) ||
      (options.refinement && motion.refinement->wrong()) ||
      (options.normal && motion.normal->wrong()) || (options.volumes && motion.volumes->wrong()) ||
      (options.examples && motion.examples->wrong());
  return motion;
}

bool Motion::by_weights() const { return options.examples && examples->known().weights; }

void constraints_met(const Bind& bind, const Motion& motion, const Output& out) {
  const dd_update_options& options = motion.options;
  const Surface& surface = bind.surface;
  const bool by_examples = options.method == DD_METHOD_EXAMPLES;
  // Nothing is promised of the base, nor of the handles in a pose by weights.
  if (options.output == DD_OUTPUT_BASE || (by_examples && motion.by_weights())) return;
  std::vector<char> used(surface.vertex_count(), 0);
  for (int32_t v : surface.triangles) used[size_t(v)] = 1;
  for (size_t v = 0; v < surface.vertex_count(); ++v) {
    const Eigen::Vector3d rest = point(surface.positions, v);
    Eigen::Vector3d found = Eigen::Map<const Eigen::Vector3f>(out.at(v)).cast<double>();
    if (options.values == DD_VALUES_OFFSETS) found += rest;
    const int32_t role = surface.roles[v];
    if (role == DD_ROLE_FIXED || (role == DD_ROLE_FREE && !used[v])) {
      promise(found == rest, "fixed and loose vertices stay at rest");
    } else if (role >= 0) {
      const Eigen::Map<const Matrix> matrix(motion.matrices.data() + 12 * size_t(role));
      const auto placed = [&](const Eigen::Vector3d& at) -> Eigen::Vector3d {
        return matrix.leftCols<3>() * at + matrix.col(3);
      };
      // A fraction of the terms that the place is the sum of; steps are taken one after another.
      const double rounding = (options.steps > 1 ? 1e-4 : 1e-6) *
                              (matrix.cwiseAbs().leftCols<3>().sum() * rest.cwiseAbs().maxCoeff() +
                               matrix.col(3).cwiseAbs().maxCoeff() + rest.cwiseAbs().maxCoeff() +
                               extent(surface.positions));
      if (!options.handle_turns || options.handle_turns[role] == DD_HANDLE_TURNS_TARGET) {
        promise((found - placed(rest)).cwiseAbs().maxCoeff() <= rounding,
                "a handle's vertices go where its matrix takes them");
      } else if (!by_examples && options.steps <= 1) {
        const Eigen::Vector3d pivot =
            options.pivots
                ? Eigen::Vector3d(Eigen::Map<const Eigen::Vector3d>(options.pivots + 3 * role))
                : centre_of(surface, role);
        promise(std::abs((found - placed(pivot)).norm() - (rest - pivot).norm()) <=
                    10 * (rounding + 1e-6 * pivot.cwiseAbs().maxCoeff() *
                                         (1 + matrix.cwiseAbs().leftCols<3>().sum())),
                "a free handle keeps its shape, and its matrix places its pivot");
      }
    }
  }
}

void facts_agree(const Bind& bind, const dd_deformer* deformer, Bytes& bytes) {
  dd_deformer_info facts{};
  facts.struct_size = sizeof facts;
  must(dd_deformer_get_info(deformer, &facts), "facts can be asked for");
  const auto n = static_cast<int32_t>(bind.surface.vertex_count());
  const auto m = static_cast<int32_t>(bind.surface.triangle_count());
  promise(facts.vertex_count == n && facts.triangle_count == m &&
              facts.handle_count == bind.surface.handle_count,
          "facts are of this mesh");
  const auto counted = [](int32_t count, int32_t example, int32_t of) {
    promise(count >= 0 && count <= of, "a count is one of things that there are");
    promise(count > 0 ? example >= 0 && example < of : example == -1,
            "an example is one of what was counted, or -1");
  };
  promise(facts.free_count > 0 && facts.free_count <= n, "something is free");
  counted(facts.resting_count, facts.resting_example, n);
  counted(facts.loose_count, facts.loose_example, n);
  counted(facts.degenerate_count, facts.degenerate_example, m);
  counted(facts.idle_handle_count, facts.idle_handle_example, facts.handle_count);
  counted(facts.far_count, facts.far_example, n);
  counted(facts.torn_count, facts.torn_example, n);
  promise(facts.unrepresented_count >= 0 && facts.stand_in_count >= 0, "counts are not negative");
  promise(facts.bytes > 0 && facts.bytes < 1e9, "memory goes with the mesh");
  std::vector<double> weights(bind.options.example_count);
  must(dd_deformer_get_example_weights(deformer, weights.data(), weights.size()),
       "weights can be asked for");
  Sized<dd_deformer_info> sized(dd_deformer_info{}, bytes);
  sized.after(dd_deformer_get_info(deformer, sized.get()));
}

}  // namespace dd::fuzz
