// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: the search for what corresponds.
#include <algorithm>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "api/arguments.h"
#include "api/defaults.h"
#include "api/job.h"
#include "match/points_of_fit.h"
#include "match/registration.h"
#include "match/triangle_match.h"

using namespace dd::api;

struct dd_match {
  dd::Positions registered;
  dd::Match match;
  std::vector<dd::PointOnTriangle> points;  // of the target's vertices
  dd_match_info facts{};
};

namespace {

dd::RegistrationOptions read_options(const dd_match_options& options) {
  dd::RegistrationOptions how;
  how.stages = whole("options.stages", options.stages, 1, 1000);
  how.rounds = whole("options.rounds", options.rounds, 1, 1000);
  how.smoothness = weight("options.smoothness", options.smoothness);
  how.threads = threads(options.threads);
  return how;
}

std::optional<dd::Similarity> read_stance(const dd_match_options& options) {
  if (!options.stance) return std::nullopt;
  return read_similarity("options.stance", options.stance);
}

/// What a match is made of, checked and copied.
struct MatchInput {
  dd::Mesh source, target;
  dd::Pairs markers;
  dd::RegistrationOptions how;
  std::optional<dd::Similarity> stance;
};

std::unique_ptr<dd_match> match_of(const MatchInput& given, const dd::Progress& progress) {
  dd::validate(given.source, dd::MeshOf::source);
  dd::validate(given.target, dd::MeshOf::target);
  const dd::Mesh& to = given.target;
  const int threads = given.how.threads;
  const bool mirrored = dd::marked_as_mirror_image(given.source, to, given.markers);
  const dd::Mesh from = mirrored ? dd::mirror_image(given.source) : given.source;
  const dd::Similarity* stance = given.stance && !mirrored ? &*given.stance : nullptr;
  const dd::Alignment alignment =
      dd::align(from, to, given.markers, threads, dd::within(progress, 0, 0.3), stance);
  auto made = std::make_unique<dd_match>();
  made->registered = dd::register_onto(from, to, given.markers, alignment, given.how,
                                       dd::within(progress, 0.3, 0.9));
  made->match = dd::match_triangles({made->registered, from.triangles}, to, given.how.reach,
                                    threads, dd::within(progress, 0.9, 0.97));
  dd::doubt_stretched(made->match, from, made->registered);
  dd::ThreadPool pool(threads);
  made->points =
      dd::points_of_fit({made->registered, from.triangles}, to, made->match.correspondence, pool);
  if (mirrored)  // whose triangles go round the other way
    for (dd::PointOnTriangle& point : made->points)
      std::swap(point.barycentric[1], point.barycentric[2]);
  dd::report(progress, 1, dd::Stage::done);
  made->facts.ambiguous = alignment.ambiguous;
  made->facts.mirrored = mirrored;
  made->facts.confidence = dd::mean_confidence(made->match, to);
  return made;
}

}  // namespace

extern "C" {

dd_status dd_match_start(const dd_mesh* source, const dd_mesh* target, const int32_t* markers,
                         size_t marker_count, const dd_match_options* options, dd_job** job) {
  return guarded([&] {
    require(job, "job is null");
    const dd_match_options read = read_struct(options, match_defaults());
    MatchInput given = {read_mesh("source", source), read_mesh("target", target),
                        read_pairs("markers", markers, marker_count), read_options(read),
                        read_stance(read)};
    start_job<dd_match>("a match", job, [given = std::move(given)](const dd::Progress& progress) {
      return match_of(given, progress);
    });
  });
}

dd_status dd_job_take_match(dd_job* job, dd_match** match) {
  return guarded([&] { take(job, "match", match); });
}

dd_status dd_match_get_positions(const dd_match* match, const dd_points_out* out) {
  return guarded([&] {
    require(match, "match is null");
    write_floats(match->registered,
                 result_points("out", out, static_cast<size_t>(match->registered.rows())));
  });
}

dd_status dd_match_get_pairs(const dd_match* match, int32_t* out, size_t capacity,
                             size_t* pair_count) {
  return guarded([&] {
    require(match, "match is null");
    require(pair_count, "pair_count is null");
    const dd::Correspondence& found = match->match.correspondence;
    const size_t count = found.source.size();
    if (capacity > 0) {
      require(out, "out is null");
      require(capacity >= count, "capacity is " + std::to_string(capacity) + ", but there are " +
                                     std::to_string(count) + " pairs");
      for (int j = 0; j < found.target_count(); ++j)
        for (int k = found.begin[j]; k < found.begin[j + 1]; ++k) {
          *out++ = found.source[k];
          *out++ = j;
        }
    }
    *pair_count = count;
  });
}

dd_status dd_match_get_points(const dd_match* match, int32_t* triangles, float* weights,
                              size_t vertex_count) {
  return guarded([&] {
    require(match, "match is null");
    require_count("triangles", triangles, vertex_count, match->points.size(), "vertices");
    require(weights, "weights is null");
    for (const dd::PointOnTriangle& point : match->points) {
      *triangles++ = point.triangle;
      for (double weight : point.barycentric)
        *weights++ = static_cast<float>(std::max(weight, 0.0));  // but for rounding
    }
  });
}

dd_status dd_match_get_confidence(const dd_match* match, float* out, size_t out_count) {
  return guarded([&] {
    require(match, "match is null");
    const std::vector<float>& confidence = match->match.confidence;
    require_count("out", out, out_count, confidence.size(), "triangles");
    std::copy(confidence.begin(), confidence.end(), out);
  });
}

dd_status dd_match_get_info(const dd_match* match, dd_match_info* info) {
  return guarded([&] {
    require(match, "match is null");
    write_struct("info", info, match->facts);
  });
}

void dd_match_free(dd_match* match) { delete match; }

}  // extern "C"
