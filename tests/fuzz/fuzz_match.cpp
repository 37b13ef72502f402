// SPDX-License-Identifier: GPL-3.0-or-later
// Searches for correspondences, between any two meshes with any markers.
#include "checks.h"
#include "meshes.h"
#include "points.h"

using namespace dd::fuzz;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Bytes bytes(data, size);
  const Surface source = any_surface(bytes);
  Surface target = source;
  const bool same = bytes.flag();
  if (same)
    target.positions = posed(source.positions, bytes);
  else
    target = any_surface(bytes);
  const auto sources = static_cast<unsigned>(std::max<size_t>(1, source.vertex_count()));
  const auto targets = static_cast<unsigned>(std::max<size_t>(1, target.vertex_count()));
  std::vector<int32_t> markers;
  for (int more = bytes.one_in(16) ? bytes.below(3) : 3 + bytes.below(6); more > 0; --more) {
    const unsigned one = bytes.seed() % sources;
    markers.push_back(bytes.odd(32) ? bytes.beyond(sources) : int32_t(one));
    markers.push_back(bytes.odd(32) ? bytes.beyond(targets)
                                    : int32_t(same ? one : bytes.seed() % targets));
  }
  markers = std::vector<int32_t>(markers);
  auto options = usual<dd_match_options>();
  const bool endless = bytes.odd(64);
  // The default numbers take long.
  options.stages = endless ? 1000 : bytes.choice(1, 3);
  options.rounds = endless ? 1000 : bytes.choice(1, 2);
  if (!endless && options.stages > 3) options.stages = 1001;
  if (!endless && options.rounds > 2) options.rounds = 1001;
  options.threads = bytes.one_in(4) ? bytes.choice(1, 3) : 1;
  if (bytes.one_in(3)) options.smoothness = bytes.number(0, 4);

  const GivenMesh from(source, bytes), to(target, bytes);
  const Sized<dd_match_options> how(options, bytes);
  dd_job* job = nullptr;
  const dd_status status = dd_match_start(bytes.pointer(from.get()), bytes.pointer(to.get()),
                                          bytes.pointer(markers.data()), markers.size() / 2,
                                          how.get(), bytes.pointer(&job));
  promise(status != DD_OK || !(how.wrong() || from.misplaced() || to.misplaced()),
          "a match with a stride or a struct_size that is none is refused");
  // A caller with an older struct would get the default numbers.
  if (how.known().stages != options.stages || how.known().rounds != options.rounds) {
    dd_job_free(job);
    return 0;
  }
  const auto match =
      taken<dd_match>(status, Owned<dd_job>(job), bytes, false, dd_job_take_match, endless);
  if (!match) return 0;

  Output registered(source.vertex_count(), bytes), packed(source.vertex_count());
  const dd_points_out into = registered.get(), again = packed.get();
  const bool there = registered.after(dd_match_get_positions(match.get(), &into));
  if (there) {
    must(dd_match_get_positions(match.get(), &again), "positions can be asked for twice");
    promise(packed.values() == registered.values(), "where points lie has no say in positions");
  }
  if (there && !endless && (from.spread() || to.spread()) && bytes.aside(2) == 1) {
    const dd_mesh packed_from = source.mesh(), packed_to = target.mesh();
    dd_match* other = nullptr;
    job = nullptr;
    must(dd_match_start(&packed_from, &packed_to, markers.data(), markers.size() / 2, how.get(),
                        &job),
         "what was matched can be matched again");
    must(dd_job_take_match(job, &other), "what was matched matches again");
    dd_job_free(job);
    const Owned<dd_match> of_packed(other);
    must(dd_match_get_positions(other, &again), "positions can be asked for");
    promise(packed.values() == registered.values(), "where points lie has no say in a match");
  }
  size_t count = 0;
  must(dd_match_get_pairs(match.get(), nullptr, 0, &count), "pairs can be counted");
  std::vector<int32_t> pairs(2 * count, -7);
  if (count > 0) {
    size_t kept = 77;
    if (count > 1)
      refused(dd_match_get_pairs(match.get(), pairs.data(), count - 1, &kept), "there is no room");
    promise(kept == 77 && pairs.front() == -7, "outputs are written only on DD_OK: pairs were");
    must(dd_match_get_pairs(match.get(), pairs.data(), count, &count), "pairs can be asked for");
  }
  promise(2 * count == pairs.size(), "there are as many pairs as were counted");
  for (size_t k = 0; k < pairs.size(); k += 2)
    promise(pairs[k] >= 0 && size_t(pairs[k]) < source.triangle_count() && pairs[k + 1] >= 0 &&
                size_t(pairs[k + 1]) < target.triangle_count(),
            "pairs are of triangles that there are");
  std::vector<float> confidence(target.triangle_count(), -7);
  must(dd_match_get_confidence(match.get(), confidence.data(), confidence.size()),
       "confidence can be asked for");
  for (float share : confidence) promise(share >= 0 && share <= 1, "confidence is from 0 to 1");
  refused(dd_match_get_confidence(match.get(), confidence.data(), confidence.size() + 1),
          "a count is checked");

  std::vector<int32_t> triangles(target.vertex_count(), -7);
  std::vector<float> weights(3 * target.vertex_count(), -7);
  must(dd_match_get_points(match.get(), triangles.data(), weights.data(), triangles.size()),
       "points can be asked for");
  for (size_t v = 0; v < triangles.size(); ++v) {
    const float* own = weights.data() + 3 * v;
    promise(triangles[v] >= -1 && triangles[v] < int32_t(source.triangle_count()),
            "points are in triangles that there are");
    promise(triangles[v] < 0 || (std::min({own[0], own[1], own[2]}) >= 0 &&
                                 std::abs(own[0] + own[1] + own[2] - 1) < 1e-3F),
            "weights of a point are none below 0, and 1 together");
  }
  return 0;
}
