// SPDX-License-Identifier: GPL-3.0-or-later
#include "api/options.h"

#include "api/defaults.h"

namespace dd::api {

namespace {

// Safety: these refuse arguments that were read from the wrong memory. In use are some ten examples
// and at most some hundred iterations.
constexpr int kMostExamples = 1000, kMostIterations = 10000;

std::vector<Positions> read_examples(const dd_bind_options& options, size_t vertex_count) {
  const size_t count = options.example_count;
  require(count <= kMostExamples, "options.example_count is " + std::to_string(count) +
                                      ", more than " + std::to_string(kMostExamples));
  require(options.examples || count == 0,
          "options.examples is null, but options.example_count is " + std::to_string(count));
  std::vector<Positions> examples;
  examples.reserve(count);
  for (size_t i = 0; i < count; ++i)
    examples.push_back(read_positions("options.examples[" + std::to_string(i) + "]",
                                      &options.examples[i], vertex_count));
  return examples;
}

void read_base(const dd_bind_options& options, size_t vertex_count, BindOptions& result) {
  require(options.base_triangles || options.base_triangle_count == 0,
          "options.base_triangles is null");
  require(!options.base_triangles || options.base,
          "options.base_triangles are given, but no options.base");
  if (!options.base) return;
  require(options.base->count > 0, "options.base has no vertices");
  if (!options.base_triangles) {
    result.base = read_positions("options.base", options.base, vertex_count);
    return;
  }
  require(options.base_triangle_count > 0,
          "options.base has no triangles, so nothing can follow it");
  require(options.base_triangle_count < kMostElements,
          "The base has more triangles than this library can number");
  result.base = read_positions("options.base", *options.base);
  result.base_triangles = Eigen::Map<const Triangles>(
      options.base_triangles, static_cast<Index>(options.base_triangle_count), 3);
}

Eigen::VectorXf read_stiffness(const dd_bind_options& options, size_t vertex_count) {
  if (!is_given("options.stiffness", options.stiffness, options.stiffness_count, vertex_count,
                "vertices"))
    return {};
  const Eigen::Map<const Eigen::VectorXf> weights(options.stiffness, Index(vertex_count));
  for (Index v = 0; v < weights.size(); ++v)
    if (!(weights[v] >= 0 && weights[v] <= 1))
      throw Error(Status::argument, {Subject::vertex, v},
                  "has a stiffness that is not between 0 and 1", Remedy::call);
  return weights;
}

Positions read_pivots(const dd_update_options& options, size_t handles) {
  if (!is_given("options.pivots", options.pivots, options.pivot_count, handles, "handles"))
    return {};
  const Positions pivots = Eigen::Map<const Positions>(options.pivots, Index(handles), 3);
  for (Index h = 0; h < pivots.rows(); ++h)
    if (!pivots.row(h).allFinite())
      throw Error(Status::argument, {Subject::handle, h}, "has a pivot that is not finite",
                  Remedy::call);
  return pivots;
}

void read_refinement(const dd_refinement_options* given, Refined& refined) {
  const dd_refinement_options options =
      read_struct(given, refinement_defaults(), "options.refinement");
  refined.iterations =
      whole("options.refinement.iterations", options.iterations, 0, kMostIterations);
  refined.rim_smoothing = fraction("options.refinement.rim_smoothing", options.rim_smoothing);
  refined.rotation_smoothing =
      fraction("options.refinement.rotation_smoothing", options.rotation_smoothing);
  refined.solidity = fraction("options.refinement.solidity", options.solidity);
}

void read_volumes(const dd_volumes_options* given, MethodOptions& method) {
  const dd_volumes_options options = read_struct(given, volumes_defaults(), "options.volumes");
  method.volume_iterations = whole("options.volumes.iterations", options.iterations, 0,
                                   std::numeric_limits<int32_t>::max());
  method.volume_tolerance = weight("options.volumes.tolerance", options.tolerance);
}

void read_examples(const dd_examples_options* given, MethodOptions& method) {
  const dd_examples_options options = read_struct(given, examples_defaults(), "options.examples");
  require(options.weights || options.weight_count == 0,
          "options.examples.weights is null, but its count is not 0");
  require(options.weight_count <= kMostExamples,
          "options.examples.weight_count is more than the examples can be");
  if (options.weights)
    method.example_weights.emplace(options.weights, options.weights + options.weight_count);
  method.example_stiffness = weight("options.examples.stiffness", options.stiffness);
  const double* limits = options.limits;
  require(limits || options.limit_count == 0,
          "options.examples.limits is null, but its count is not 0");
  require(options.limit_count <= kMostExamples,
          "options.examples.limit_count is more than the examples can be");
  for (size_t i = 0; i < options.limit_count; ++i)
    if (!(limits[2 * i] <= 0 && limits[2 * i + 1] >= 0))
      throw Error(Status::argument, {Subject::example, static_cast<Index>(i)},
                  "has limits that are not zero or less and zero or more", Remedy::call);
  if (limits) method.example_limits = {limits, limits + 2 * options.limit_count};
}

}  // namespace

Bind read_bind_options(const dd_bind_options* given, size_t vertex_count) {
  const dd_bind_options options = read_struct(given, bind_defaults());
  Bind bind;
  BindOptions& result = bind.options;
  result.base_metric = choice("options.base_metric", options.base_metric, BaseMetric::base);
  result.metric_smoothing = weight("options.metric_smoothing", options.metric_smoothing);
  result.smoothness = choice("options.smoothness", options.smoothness,
                             Smoothness::curvature_variation, Smoothness::membrane);
  result.triangulation =
      choice("options.triangulation", options.triangulation, Triangulation::given);
  result.precision = choice("options.precision", options.precision, Precision::full);
  result.threads = threads(options.threads);
  read_base(options, vertex_count, result);
  result.examples = read_examples(options, vertex_count);
  result.stiffness = read_stiffness(options, vertex_count);
  bind.with_draft = yes_or_no("options.draft", options.draft);
  return bind;
}

Update read_update_options(const dd_update_options* given, const Deformer& deformer) {
  const dd_update_options options = read_struct(given, update_defaults());
  Update result;
  result.options.method = choice("options.method", options.method, MethodKind::examples);
  result.options.base_deformer =
      choice("options.base_deformer", options.base_deformer, BaseDeformer::motions);
  result.options.output = choice("options.output", options.output, Output::base);
  result.values = choice("options.values", options.values, Values::offsets);

  MethodOptions& of_method = result.options.of_method;
  of_method.rotation_only = rotations_only(options.gradients);
  of_method.formulation =
      choice("options.formulation", options.formulation, Formulation::fourth_points_unweighted);
  read_refinement(options.refinement, of_method.refined);
  of_method.levels =
      whole("options.normal.levels",
            read_struct(options.normal, normal_defaults(), "options.normal").levels, 1, 20);
  read_volumes(options.volumes, of_method);
  read_examples(options.examples, of_method);

  result.motion.steps = whole("options.steps", options.steps, 1, 1000);
  const size_t handles = count_of(deformer.region().handle_count);
  if (is_given("options.turns", options.turns, options.turn_count, handles, "handles"))
    result.options.turns.assign(options.turns, options.turns + 3 * options.turn_count);
  if (is_given("options.handle_turns", options.handle_turns, options.handle_turn_count, handles,
               "handles"))
    for (size_t h = 0; h < handles; ++h)
      result.options.free.push_back(choice("options.handle_turns", options.handle_turns[h],
                                           DD_HANDLE_TURNS_FREE) == DD_HANDLE_TURNS_FREE);
  result.options.pivots = read_pivots(options, handles);
  result.deformed_base =
      read_optional_positions("options.base", options.base, count_of(deformer.base_vertex_count()));
  return result;
}

}  // namespace dd::api
