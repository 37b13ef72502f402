// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: deformation transfer between meshes.
#include <Eigen/LU>
#include <cmath>
#include <memory>
#include <optional>
#include <utility>

#include "api/defaults.h"
#include "api/job.h"
#include "api/options.h"
#include "deform/mesh_transfer.h"

using namespace dd::api;

struct dd_transfer {
  template <class... Arguments>
  explicit dd_transfer(Arguments&&... arguments)
      : transfer(std::forward<Arguments>(arguments)...) {}
  dd::MeshTransfer transfer;
  std::atomic<bool> busy{false};
};

namespace {

/// What a transfer is made of, checked and copied.
struct Given {
  dd::Mesh source, target;
  std::optional<dd::Pairs> pairs;  // none: of the same topology
  enum class PairsOf { triangles, vertices, nearest } pairs_of = PairsOf::triangles;
  std::optional<dd::Similarity> placement;
  dd::TransferOptions options;

  dd::Correspondence correspondence() const {
    if (!pairs) return dd::identity_correspondence(source, target);
    if (pairs_of == PairsOf::vertices) return dd::vertex_correspondence(*pairs, source, target);
    return dd::triangle_correspondence(*pairs, source.triangle_count(), target.triangle_count());
  }
};

void read_points(const dd_transfer_options& options, Given& given) {
  if (!options.point_triangles && !options.point_weights) return;
  require(given.pairs_of != Given::PairsOf::nearest,
          "options.point_triangles is not null, but options.pairs_of is DD_PAIRS_OF_NEAREST, which "
          "finds the points");
  const size_t count = count_of(given.target.vertex_count());
  require_count("options.point_triangles", options.point_triangles, options.point_triangle_count,
                count, "vertices");
  require_count("options.point_weights", options.point_weights, options.point_weight_count, count,
                "vertices");
  given.options.points.resize(count);
  for (size_t v = 0; v < count; ++v) {
    dd::PointOnTriangle& point = given.options.points[v];
    point.triangle = options.point_triangles[v];
    point.barycentric =
        Eigen::Map<const Eigen::Vector3f>(options.point_weights + 3 * v).cast<double>();
  }
}

void read_options(const dd_transfer_options& options, Given& given) {
  given.pairs_of = choice("options.pairs_of", options.pairs_of, Given::PairsOf::nearest);
  if (options.placement) given.placement = read_similarity("options.placement", options.placement);
  dd::TransferOptions& how = given.options;
  how.formulation =
      choice("options.formulation", options.formulation, dd::Formulation::fourth_points_unweighted);
  how.anchor = choice("options.anchor", options.anchor, dd::Anchor::pinned);
  require(options.anchors || options.anchor_count == 0, "options.anchors is null");
  require(options.anchor_count < kMostElements,
          "options.anchor_count is more than can be numbered");
  how.anchors.assign(options.anchors, options.anchors + options.anchor_count);
  how.precision = choice("options.precision", options.precision, dd::Precision::full);
  how.threads = threads(options.threads);
  require(std::isfinite(options.gap), "options.gap is not finite");
  how.gap = options.gap;
  how.placing = choice("options.placing", options.placing, dd::Placing::displacements);
  read_points(options, given);
}

std::unique_ptr<dd_transfer> transfer_of(const Given& given, const dd::Progress& progress) {
  dd::TransferOptions how = given.options;
  if (given.placement) how.placement = &*given.placement;
  if (given.pairs_of != Given::PairsOf::nearest)
    return std::make_unique<dd_transfer>(given.source, given.target, given.correspondence(), how,
                                         progress);
  dd::validate(given.source, dd::MeshOf::source);
  dd::validate(given.target, dd::MeshOf::target);
  dd::ThreadPool pool(how.threads);
  const dd::NearestPoints points(given.source, given.target,
                                 given.placement.value_or(dd::Similarity{}), pool);
  how.worn = &points;
  return std::make_unique<dd_transfer>(given.source, given.target,
                                       points.correspondence(given.source, given.target), how,
                                       dd::within(progress, 0.1, 1));
}

}  // namespace

extern "C" {

dd_status dd_transfer_start(const dd_mesh* source, const dd_mesh* target, const int32_t* pairs,
                            size_t pair_count, const dd_transfer_options* options, dd_job** job) {
  return guarded([&] {
    require(job, "job is null");
    Given given;
    given.source = read_mesh("source", source);
    given.target = read_mesh("target", target);
    if (pairs || pair_count > 0) given.pairs = read_pairs("pairs", pairs, pair_count);
    read_options(read_struct(options, transfer_defaults()), given);
    require(!given.pairs || given.pairs_of != Given::PairsOf::nearest,
            "pairs is not null, but options.pairs_of is DD_PAIRS_OF_NEAREST, which finds them");
    start_job<dd_transfer>("a transfer", job,
                           [given = std::move(given)](const dd::Progress& progress) {
                             return transfer_of(given, progress);
                           });
  });
}

dd_status dd_job_take_transfer(dd_job* job, dd_transfer** transfer) {
  return guarded([&] { take(job, "transfer", transfer); });
}

dd_status dd_transfer_apply(dd_transfer* transfer, const dd_points* pose,
                            const dd_apply_options* options, const dd_points_out* out) {
  return guarded([&] {
    require(transfer, "transfer is null");
    const InUse in_use(transfer->busy, "transfer");
    dd::MeshTransfer& bound = transfer->transfer;
    const dd::Positions posed =
        read_positions("pose", pose, count_of(bound.source().vertex_count()));
    Strided<FloatRows> result = result_points("out", out, count_of(bound.target().vertex_count()));
    const dd_apply_options how = read_struct(options, apply_defaults());
    const bool rotation_only = rotations_only(how.gradients);
    const Values values = choice("options.values", how.values, Values::offsets);
    const dd::Positions places = read_optional_positions("options.places", how.places,
                                                         count_of(bound.anchor_count()), "anchors");
    const dd::Positions& found =
        bound.apply(posed, rotation_only, places.size() ? &places : nullptr);
    if (values == Values::offsets)
      write_floats(found - bound.target().positions, result);
    else
      write_floats(found, result);
  });
}

dd_status dd_transfer_get_info(const dd_transfer* transfer, dd_transfer_info* info) {
  return guarded([&] {
    require(transfer, "transfer is null");
    const dd::MeshTransfer& bound = transfer->transfer;
    dd_transfer_info facts{};
    facts.unmatched_count = bound.gradients().unmatched_count();
    facts.unmatched_example = bound.gradients().unmatched_example();
    facts.unmatched_component_count = bound.unmatched_component_count();
    facts.unmatched_component_example = bound.unmatched_component_example();
    facts.loose_count = bound.isolated_count();
    const std::vector<int>& degenerate = bound.degenerate_triangles();
    facts.degenerate_count = static_cast<int32_t>(degenerate.size());
    facts.degenerate_example = degenerate.empty() ? -1 : degenerate.front();
    facts.mirrored = bound.mirrored();
    facts.unknowns = bound.unknowns();
    facts.nonzeros = bound.nonzeros();
    Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> placement(facts.placement);
    placement.leftCols<3>() = bound.placement().scale * bound.placement().rotation;
    placement.col(3) = bound.placement().shift;
    facts.overstretched_count = bound.gradients().overstretched_count();
    facts.overstretched_example = bound.gradients().overstretched_example();
    facts.through_count = bound.through_count();
    facts.through_example = bound.through_example();
    facts.worn_distance = bound.worn_distance();
    write_struct("info", info, facts);
  });
}

void dd_transfer_free(dd_transfer* transfer) { delete transfer; }

}  // extern "C"
