// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: deformation transfer between meshes, and the search for what corresponds.
#include <Eigen/LU>
#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <memory>
#include <string>
#include <utility>

#include "api/c_api_job.h"
#include "api/c_api_support.h"
#include "transfer/mesh_transfer.h"
#include "transfer/registration.h"

using namespace dd::c_api;

struct dd_transfer {
  dd_transfer(dd::Mesh source, dd::Mesh target, const dd::Correspondence& correspondence,
              const dd::TransferOptions& options)
      : transfer(std::move(source), std::move(target), correspondence, options) {}
  dd::MeshTransfer transfer;
  std::atomic<bool> busy{false};
};

// The job comes last: it is joined before what it writes to is gone.
struct dd_match {
  dd::Mesh source, target;
  dd::Positions fitted;
  dd::Match match;
  std::atomic<bool> found{false};
  Job job;
};

namespace {

dd::Pairs read_pairs(const char* name, const int32_t* values, size_t count) {
  require(values || count == 0, std::string(name) + " is null.");
  require(count % 2 == 0, std::string(name) + " has " + std::to_string(count) +
                              " elements, which is not two a pair.");
  dd::Pairs pairs(count / 2);
  for (size_t i = 0; i < pairs.size(); ++i) pairs[i] = {values[2 * i], values[2 * i + 1]};
  return pairs;
}

dd::Similarity read_placement(const double* values) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(values);
  dd::Similarity placement;
  placement.scale = std::cbrt(matrix.leftCols<3>().determinant());
  placement.rotation = matrix.leftCols<3>() / placement.scale;
  placement.shift = matrix.col(3);
  const Eigen::Matrix3d product = placement.rotation.transpose() * placement.rotation;
  require(matrix.allFinite() && placement.scale > 0 && product.isIdentity(1e-4),
          "options.placement is not a rotation with a positive scale and a shift.");
  return placement;
}

dd::Correspondence read_correspondence(bool given, const dd::Pairs& pairs, int32_t pairs_of,
                                       const dd::Mesh& source, const dd::Mesh& target) {
  if (!given) return dd::same_topology(source, target);
  if (pairs_of == DD_PAIRS_OF_VERTICES) return dd::vertex_correspondence(pairs, source, target);
  return dd::triangle_correspondence(pairs, source.triangle_count(), target.triangle_count());
}

void write_positions(const dd::Positions& positions, float* out) {
  if (!(positions.cwiseAbs().maxCoeff() < 0.5 * std::numeric_limits<float>::max()))
    throw dd::Error(dd::Status::numeric,
                    "The pose is too large: the target leaves the range of single precision.");
  Eigen::Map<FloatRows>(out, positions.rows(), 3) = positions.cast<float>();
}

const dd_match& finished(const dd_match* match) {
  require(match, "match is null.");
  require(match->found, "There is no match: dd_match_finish comes first.");
  return *match;
}

}  // namespace

extern "C" {

int32_t dd_transfer_create(const float* source_positions, size_t source_position_count,
                           const int32_t* source_triangles, size_t source_index_count,
                           const float* target_positions, size_t target_position_count,
                           const int32_t* target_triangles, size_t target_index_count,
                           const int32_t* pairs, size_t pair_value_count,
                           const dd_transfer_options* given, dd_transfer** transfer) {
  return guarded([&] {
    require(transfer, "transfer is null.");
    const dd_transfer_options options = read_struct("options", given, dd_transfer_options{});
    require(options.pairs_of == DD_PAIRS_OF_TRIANGLES || options.pairs_of == DD_PAIRS_OF_VERTICES,
            "options.pairs_of is " + std::to_string(options.pairs_of) + ", which is neither.");
    require(options.formulation >= DD_FORMULATION_SURFACE &&
                options.formulation <= DD_FORMULATION_FOURTH_POINTS_UNWEIGHTED,
            "options.formulation is " + std::to_string(options.formulation) + ", which is none.");
    require(options.anchor >= DD_ANCHOR_SOURCE && options.anchor <= DD_ANCHOR_PINNED,
            "options.anchor is " + std::to_string(options.anchor) + ", which is none.");
    require(options.anchors || options.anchor_count == 0, "options.anchors is null.");
    require(
        options.precision == DD_PRECISION_SINGLE || options.precision == DD_PRECISION_DOUBLE,
        "options.precision is " + std::to_string(options.precision) + ", not single or double.");
    require(options.threads >= 0 && options.threads <= 1024,
            "options.threads is " + std::to_string(options.threads) + ", not between 0 and 1024.");
    dd::Mesh source =
        read_mesh(source_positions, source_position_count, source_triangles, source_index_count);
    dd::Mesh target =
        read_mesh(target_positions, target_position_count, target_triangles, target_index_count);
    const dd::Correspondence correspondence =
        read_correspondence(pairs != nullptr, read_pairs("pairs", pairs, pair_value_count),
                            options.pairs_of, source, target);
    dd::Similarity placement;
    dd::TransferOptions how;
    if (options.placement) {
      placement = read_placement(options.placement);
      how.placement = &placement;
    }
    how.formulation = static_cast<dd::Formulation>(options.formulation);
    how.anchor = static_cast<dd::Anchor>(options.anchor);
    if (options.anchor_count > 0)
      how.anchors.assign(options.anchors, options.anchors + options.anchor_count);
    how.precision =
        options.precision == DD_PRECISION_SINGLE ? dd::Precision::single : dd::Precision::full;
    how.threads = options.threads;
    *transfer = new dd_transfer(std::move(source), std::move(target), correspondence, how);
  });
}

int32_t dd_transfer_apply(dd_transfer* transfer, const float* pose, size_t pose_count,
                          int32_t rotation_only, const float* places, size_t place_count,
                          float* out, size_t out_count) {
  return guarded([&] {
    require(transfer, "transfer is null.");
    require(pose && out, "pose or out is null.");
    require(rotation_only == 0 || rotation_only == 1, "rotation_only must be 0 or 1.");
    const InUse in_use(transfer->busy, "transfer");
    dd::MeshTransfer& bound = transfer->transfer;
    require_size("pose", pose_count, 3 * static_cast<size_t>(bound.source().vertex_count()));
    require_size("out", out_count, 3 * static_cast<size_t>(bound.target().vertex_count()));
    require_size("places", place_count, places ? 3 * static_cast<size_t>(bound.anchor_count()) : 0);
    const auto read = [](const float* values, size_t count) -> dd::Positions {
      return Eigen::Map<const FloatRows>(values, static_cast<Eigen::Index>(count / 3), 3)
          .cast<double>();
    };
    const dd::Positions given = places ? read(places, place_count) : dd::Positions();
    write_positions(
        bound.apply(read(pose, pose_count), rotation_only == 1, places ? &given : nullptr), out);
  });
}

int32_t dd_transfer_get_info(const dd_transfer* transfer, dd_transfer_info* info) {
  return guarded([&] {
    require(transfer, "transfer is null.");
    const dd::MeshTransfer& bound = transfer->transfer;
    dd_transfer_info facts{};
    facts.unmatched_count = bound.gradients().unmatched_count();
    facts.unmatched_example = bound.gradients().unmatched_example();
    facts.unmatched_part_count = bound.unmatched_component_count();
    facts.unmatched_part_example = bound.unmatched_component_example();
    facts.loose_count = bound.loose_count();
    const std::vector<int>& degenerate = bound.degenerate_triangles();
    facts.degenerate_count = static_cast<int32_t>(degenerate.size());
    facts.degenerate_example = degenerate.empty() ? -1 : degenerate.front();
    facts.mirrored = bound.mirrored();
    facts.unknowns = bound.unknowns();
    facts.nonzeros = bound.nonzeros();
    Eigen::Map<Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> placement(facts.placement);
    placement.leftCols<3>() = bound.placement().scale * bound.placement().rotation;
    placement.col(3) = bound.placement().shift;
    write_struct("info", info, facts);
  });
}

void dd_transfer_free(dd_transfer* transfer) { delete transfer; }

int32_t dd_match_start(const float* source_positions, size_t source_position_count,
                       const int32_t* source_triangles, size_t source_index_count,
                       const float* target_positions, size_t target_position_count,
                       const int32_t* target_triangles, size_t target_index_count,
                       const int32_t* markers, size_t marker_value_count,
                       const dd_match_options* given, dd_match** match) {
  return guarded([&] {
    require(match, "match is null.");
    const dd_match_options options = read_struct("options", given, dd_match_options{});
    dd::RegistrationOptions how;
    require(options.stages >= 0 && options.stages <= 1000, "options.stages is not 0 to 1000.");
    require(options.rounds >= 0 && options.rounds <= 1000, "options.rounds is not 0 to 1000.");
    require(options.threads >= 0 && options.threads <= 1024,
            "options.threads is not between 0 and 1024.");
    for (const double value : {options.smoothness, options.identity, options.reach})
      require(value >= 0 && std::isfinite(value),
              "A weight or the reach in options is negative or not finite.");
    if (options.stages) how.stages = options.stages;
    if (options.rounds) how.rounds = options.rounds;
    if (options.smoothness > 0) how.smoothness = options.smoothness;
    if (options.identity > 0) how.identity = options.identity;
    if (options.reach > 0) how.reach = options.reach;
    how.threads = options.threads;
    auto started = std::make_unique<dd_match>();
    started->source =
        read_mesh(source_positions, source_position_count, source_triangles, source_index_count);
    started->target =
        read_mesh(target_positions, target_position_count, target_triangles, target_index_count);
    started->job.start([&of = *started, how,
                        pairs = read_pairs("markers", markers, marker_value_count)](
                           const dd::Progress& progress) {
      of.fitted = dd::register_onto(of.source, of.target, pairs, how, dd::within(progress, 0, 0.9));
      of.match = dd::match_triangles({of.fitted, of.source.triangles}, of.target, how.reach,
                                     how.threads, dd::within(progress, 0.9, 1));
      of.found = true;
    });
    *match = started.release();
  });
}

int32_t dd_match_poll(dd_match* match, dd_bind_progress* progress) {
  return guarded([&] {
    require(match, "match is null.");
    match->job.poll(progress);
  });
}

int32_t dd_match_cancel(dd_match* match) {
  return guarded([&] {
    require(match, "match is null.");
    match->job.cancel();
  });
}

int32_t dd_match_finish(dd_match* match) {
  return guarded([&] {
    require(match, "match is null.");
    match->job.finish();
  });
}

int32_t dd_match_get_positions(dd_match* match, float* out, size_t out_count) {
  return guarded([&] {
    const dd_match& of = finished(match);
    require(out, "out is null.");
    require_size("out", out_count, static_cast<size_t>(of.fitted.size()));
    write_positions(of.fitted, out);
  });
}

int32_t dd_match_get_pairs(dd_match* match, int32_t* pairs, size_t capacity, size_t* value_count) {
  return guarded([&] {
    const dd::Correspondence& found = finished(match).match.correspondence;
    require(value_count, "value_count is null.");
    const size_t count = 2 * found.source.size();
    if (capacity > 0) {
      require(pairs, "pairs is null.");
      require(capacity >= count, "capacity is " + std::to_string(capacity) + ", but there are " +
                                     std::to_string(count) + " values.");
      for (int j = 0; j < found.target_count(); ++j)
        for (int k = found.begin[j]; k < found.begin[j + 1]; ++k) {
          *pairs++ = found.source[k];
          *pairs++ = j;
        }
    }
    *value_count = count;
  });
}

int32_t dd_match_get_confidence(dd_match* match, float* out, size_t out_count) {
  return guarded([&] {
    const std::vector<float>& confidence = finished(match).match.confidence;
    require(out, "out is null.");
    require_size("out", out_count, confidence.size());
    std::copy(confidence.begin(), confidence.end(), out);
  });
}

void dd_match_free(dd_match* match) { delete match; }

}  // extern "C"
