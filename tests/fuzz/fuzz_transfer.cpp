// SPDX-License-Identifier: GPL-3.0-or-later
// Transfers between any two meshes, by any pairs and options, of any poses.
#include "checks.h"
#include "meshes.h"

using namespace dd::fuzz;

namespace {

/// Of numbers below these, or beyond.
std::vector<int32_t> any_pairs(int32_t sources, int32_t targets, Bytes& bytes) {
  std::vector<int32_t> pairs;
  const unsigned seed = bytes.seed();
  const int count = bytes.one_in(4) ? bytes.below(8) : 1 + bytes.below(256);
  for (int k = 0; k < count; ++k) {
    // Neighbours' numbers are near, so that the pairs have a meaning as a whole.
    pairs.push_back(int32_t((seed + unsigned(k)) % unsigned(std::max(1, sources))));
    pairs.push_back(int32_t((3 * seed + unsigned(k)) % unsigned(std::max(1, targets))));
  }
  if (bytes.odd(8) && !pairs.empty())
    pairs[size_t(bytes.below(static_cast<int>(pairs.size())))] = bytes.beyond(size_t(sources));
  return pairs;
}

void facts_agree(const dd_transfer* transfer, const Surface& target, Bytes& bytes) {
  dd_transfer_info facts{};
  facts.struct_size = sizeof facts;
  must(dd_transfer_get_info(transfer, &facts), "facts can be asked for");
  const auto n = static_cast<int32_t>(target.vertex_count());
  const auto m = static_cast<int32_t>(target.triangle_count());
  promise(facts.unmatched_count >= 0 && facts.unmatched_count <= m &&
              facts.unmatched_example >= -1 && facts.unmatched_example < m &&
              facts.unmatched_component_example >= -1 && facts.unmatched_component_example < n &&
              facts.loose_count >= 0 && facts.loose_count <= n && facts.degenerate_count >= 0 &&
              facts.degenerate_count <= m && facts.degenerate_example >= -1 &&
              facts.degenerate_example < m && facts.unknowns >= 0,
          "a count is one of things that there are");
  for (double number : facts.placement) promise(std::isfinite(number), "a placement is finite");
  Sized<dd_transfer_info> sized(dd_transfer_info{}, bytes);
  sized.after(dd_transfer_get_info(transfer, sized.get()));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Bytes bytes(data, size);
  const Surface source = any_surface(bytes);
  Surface target = source;
  std::vector<int32_t> pairs;
  dd_transfer_options options{};
  options.struct_size = sizeof options;
  options.pairs_of = bytes.choice(DD_PAIRS_OF_NEAREST);
  const bool same = bytes.flag(), in_place = same && bytes.flag();
  if (!same) {
    target = any_surface(bytes);
    const bool of_vertices = options.pairs_of == DD_PAIRS_OF_VERTICES;
    // Given where none should be, they are refused.
    if (options.pairs_of != DD_PAIRS_OF_NEAREST || bytes.odd())
      pairs =
          any_pairs(int32_t(of_vertices ? source.vertex_count() : source.triangle_count()),
                    int32_t(of_vertices ? target.vertex_count() : target.triangle_count()), bytes);
  } else if (!in_place) {
    target.positions = posed(source.positions, bytes);
  }
  options.formulation = bytes.choice(DD_FORMULATION_FOURTH_POINTS_UNWEIGHTED);
  options.anchor = bytes.choice(DD_ANCHOR_PINNED);
  const bool anchored = options.anchor == DD_ANCHOR_VERTICES || options.anchor == DD_ANCHOR_PINNED;
  std::vector<int32_t> anchors;
  if (anchored || bytes.odd())
    for (int more = 1 + bytes.below(6); more > 0; --more) {
      const int32_t one = int32_t(bytes.seed() % std::max<size_t>(1, target.vertex_count()));
      // Named twice it is refused.
      if (std::find(anchors.begin(), anchors.end(), one) == anchors.end() || bytes.odd())
        anchors.push_back(bytes.odd(8) ? bytes.beyond(target.vertex_count()) : one);
    }
  options.anchors = anchors.empty() ? nullptr : anchors.data();
  options.anchor_count = anchors.size();
  options.precision = bytes.choice(DD_PRECISION_DOUBLE);
  options.threads = bytes.one_in(4) ? bytes.choice(3) : 1;
  double placement[12] = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};
  const bool given = bytes.one_in(4);
  if (given) {
    const double scale = bytes.number(0.2, 4), angle = bytes.number(-3, 3);
    placement[0] = placement[5] = scale * std::cos(angle);
    placement[4] = scale * std::sin(angle);
    placement[1] = -placement[4];
    placement[3] = bytes.number(-9, 9);
    placement[10] = placement[3] < 0 ? -scale : scale;  // a reflection
    options.placement = placement;
  }
  options.placing = bytes.choice(DD_PLACING_DISPLACEMENTS);
  options.gap = bytes.number(-0.1, 1);
  std::vector<int32_t> point_triangles;
  std::vector<float> point_weights;
  // Of the nearest, none are taken.
  if (options.pairs_of == DD_PAIRS_OF_NEAREST ? bytes.odd(16) : bytes.one_in(3)) {
    const auto m = int32_t(std::max<size_t>(1, source.triangle_count()));
    for (size_t v = 0; v < target.vertex_count(); ++v) {
      point_triangles.push_back(int32_t(v) % 5 == 4 ? -1 : int32_t(v) % m);
      const float share = float(v % 7) / 6;
      point_weights.insert(point_weights.end(), {share, 1 - share, 0});
    }
    if (bytes.odd(8) && !point_triangles.empty())
      point_triangles[bytes.seed() % point_triangles.size()] =
          bytes.beyond(source.triangle_count());
    if (bytes.odd(8)) disturb(point_weights, bytes);
    options.point_triangles = point_triangles.data();
    options.point_weights = point_weights.data();
    options.point_triangle_count = bytes.count(target.vertex_count());
    options.point_weight_count = bytes.count(target.vertex_count());
  }

  const dd_mesh from = source.mesh(), to = target.mesh();
  const Sized<dd_transfer_options> how(options, bytes);
  dd_job* job = nullptr;
  const int32_t status = dd_transfer_start(bytes.pointer(&from), bytes.pointer(&to),
                                           pairs.empty() ? nullptr : pairs.data(), pairs.size() / 2,
                                           bytes.odd() ? nullptr : how.get(), bytes.pointer(&job));
  const bool tame = bytes.tame() && source.sound && target.sound && same;
  const auto transfer =
      taken<dd_transfer>(status, Owned<dd_job>(job), bytes, tame && in_place, dd_job_take_transfer);
  if (!transfer) return 0;
  facts_agree(transfer.get(), target, bytes);

  for (int more = 1 + bytes.below(3); more > 0; --more) {
    const bool at_rest = bytes.one_in(4);
    const std::vector<float> pose = at_rest ? source.positions : posed(source.positions, bytes);
    dd_apply_options applied{};
    applied.struct_size = sizeof applied;
    applied.gradients = bytes.choice(DD_GRADIENTS_WHOLE);
    applied.values = bytes.choice(DD_VALUES_OFFSETS);
    std::vector<float> places;
    if (!anchors.empty() && bytes.one_in(3)) {
      for (size_t k = 0; k < 3 * anchors.size(); ++k)
        places.push_back(static_cast<float>(bytes.between(-2, 2)));
      if (bytes.odd(8)) disturb(places, bytes);
      applied.places = places.data();
      applied.place_count = bytes.count(anchors.size());
    }
    const Sized<dd_apply_options> as(applied, bytes);
    Output<float> out(target.vertex_count()), again(target.vertex_count());
    const auto apply = [&](Output<float>& into) {
      return dd_transfer_apply(transfer.get(), pose.data(), source.vertex_count(), as.get(),
                               into.data(), target.vertex_count());
    };
    const bool there = out.after(apply(out));
    promise(again.after(apply(again)) == there && again.values() == out.values(),
            "a pose once more gives the same");
    promise(there || !(tame && in_place), "what is nothing out of the way doesn't fail");
    if (!there || !at_rest || !tame || !in_place || given || !places.empty()) continue;
    const double allowed = 1e-3 * extent(target.positions);
    for (size_t k = 0; k < out.values().size(); ++k)
      promise(std::abs(double(out.values()[k]) -
                       (applied.values == DD_VALUES_OFFSETS ? 0 : double(target.positions[k]))) <=
                  allowed,
              "onto itself a pose at rest comes back");
    Output<float> refused_one(target.vertex_count());
    refused_one.after(dd_transfer_apply(
        transfer.get(), bytes.pointer(pose.data()), bytes.count(source.vertex_count()), as.get(),
        bytes.pointer(refused_one.data()), bytes.count(target.vertex_count())));
  }
  return 0;
}
