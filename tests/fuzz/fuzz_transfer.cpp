// SPDX-License-Identifier: GPL-3.0-or-later
// Transfers between any two meshes, by any pairs and options, of any poses.
#include "checks.h"
#include "meshes.h"
#include "points.h"

using namespace dd::fuzz;

namespace {

/// Pairs of numbers below `sources` and `targets`; in a wild input now and then beyond.
std::vector<int32_t> any_pairs(int32_t sources, int32_t targets, Bytes& bytes) {
  std::vector<int32_t> pairs;
  const unsigned seed = bytes.seed();
  const int count = bytes.one_in(4) ? bytes.below(8) : 1 + bytes.below(256);
  for (int k = 0; k < count; ++k) {
    // Consecutive numbers, so that neighbours are paired with neighbours.
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
  const Sized<dd_transfer_info> sized(dd_transfer_info{}, bytes);
  sized.after(dd_transfer_get_info(transfer, sized.get()));
}

/// The same transfer of packed meshes.
Owned<dd_transfer> made(const Surface& source, const Surface& target,
                        const std::vector<int32_t>& pairs, const dd_transfer_options* options) {
  const dd_mesh from = source.mesh(), to = target.mesh();
  dd_job* started = nullptr;
  dd_transfer* transfer = nullptr;
  must(dd_transfer_start(&from, &to, pairs.empty() ? nullptr : pairs.data(), pairs.size() / 2,
                         options, &started),
       "what was transferred can be transferred again");
  const Owned<dd_job> job(started);
  must(dd_job_take_transfer(job.get(), &transfer), "what was transferred transfers again");
  return Owned<dd_transfer>(transfer);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Bytes bytes(data, size);
  const Surface source = any_surface(bytes);
  Surface target = source;
  std::vector<int32_t> pairs;
  auto options = usual<dd_transfer_options>();
  options.pairs_of = bytes.choice(DD_PAIRS_OF_NEAREST);
  const bool same = bytes.flag(), in_place = same && bytes.flag();
  if (!same) {
    target = any_surface(bytes);
    const bool of_vertices = options.pairs_of == DD_PAIRS_OF_VERTICES;
    // With nearest points for pairs, given ones are refused.
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
      // An anchor that is named twice is refused.
      if (std::find(anchors.begin(), anchors.end(), one) == anchors.end() || bytes.odd())
        anchors.push_back(bytes.odd(8) ? bytes.beyond(target.vertex_count()) : one);
    }
  options.anchors = anchors.empty() ? nullptr : anchors.data();
  options.anchor_count = anchors.size();
  options.precision = bytes.choice(DD_PRECISION_DOUBLE);
  options.threads = bytes.one_in(4) ? bytes.choice(1, 3) : 1;
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
  // With nearest points for pairs, given points are refused.
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

  const GivenMesh from(source, bytes), to(target, bytes);
  const Sized<dd_transfer_options> how(options, bytes);
  const dd_transfer_options* as = bytes.odd() ? nullptr : how.get();
  const int32_t* given_pairs = pairs.empty() ? nullptr : pairs.data();
  dd_job* job = nullptr;
  const dd_status status =
      dd_transfer_start(bytes.pointer(from.get()), bytes.pointer(to.get()), given_pairs,
                        pairs.size() / 2, as, bytes.pointer(&job));
  promise(status != DD_OK || !((as && how.wrong()) || from.misplaced() || to.misplaced()),
          "a transfer with a stride or a struct_size that is none is refused");
  const bool tame = bytes.tame() && source.sound && target.sound && same;
  const auto transfer =
      taken<dd_transfer>(status, Owned<dd_job>(job), bytes, tame && in_place, dd_job_take_transfer);
  if (!transfer) return 0;
  facts_agree(transfer.get(), target, bytes);
  Owned<dd_transfer> of_packed;
  if ((from.spread() || to.spread()) && bytes.aside(2) == 1)
    of_packed = made(source, target, pairs, as);

  const dd_placing placing = as ? how.known().placing : usual<dd_transfer_options>().placing;
  const bool takes_whole = placing == DD_PLACING_VERTICES || placing == DD_PLACING_DISPLACEMENTS;
  for (int more = 1 + bytes.below(3); more > 0; --more) {
    const bool at_rest = bytes.one_in(4);
    const Points pose(at_rest ? source.positions : posed(source.positions, bytes), bytes);
    auto applied = usual<dd_apply_options>();
    applied.gradients = bytes.choice(DD_GRADIENTS_WHOLE);
    // Rotations are refused with these placings, which is tried now and then.
    if (takes_whole && bytes.aside(4) != 3) applied.gradients = DD_GRADIENTS_WHOLE;
    applied.values = bytes.choice(DD_VALUES_OFFSETS);
    Points places;
    if (!anchors.empty() && bytes.one_in(3)) {
      std::vector<float> values;
      for (size_t k = 0; k < 3 * anchors.size(); ++k)
        values.push_back(static_cast<float>(bytes.between(-2, 2)));
      if (bytes.odd(8)) disturb(values, bytes);
      places = Points(std::move(values), bytes);
      *places.given() = counted(*places.given(), bytes);
      applied.places = places.given();
    }
    const Sized<dd_apply_options> with(applied, bytes);
    const dd_apply_options known = with.known();
    const bool fits = !takes_whole || known.gradients == DD_GRADIENTS_WHOLE;
    const bool wrong = with.wrong() || pose.misplaced() || (known.places && places.misplaced());
    Output out(target.vertex_count(), bytes), again(target.vertex_count());
    const dd_points_out into = out.get(), packed_into = again.get();
    const bool there =
        out.after(dd_transfer_apply(transfer.get(), pose.given(), with.get(), &into));
    promise(!there || !wrong, "a pose with a stride or a struct_size that is none is refused");
    promise(!there || fits, "such places are refused with rotations");
    promise(there || !(tame && in_place && fits), "what is nothing out of the way doesn't fail");
    promise(there || !(tame && in_place) || last_error().remedy == DD_REMEDY_WHOLE_GRADIENTS,
            "who asks for rotations is told that they don't go with such places");
    if (wrong || out.misplaced()) continue;
    // The same with packed points, and by the transfer of packed meshes.
    places.pack();
    const dd_points packed = pose.packed();
    dd_transfer* other = of_packed ? of_packed.get() : transfer.get();
    promise(again.after(dd_transfer_apply(other, &packed, with.get(), &packed_into)) == there &&
                again.values() == out.values(),
            "a pose once more gives the same, wherever points lie");
    if (!there || !at_rest || !tame || !in_place || given || places.given()) continue;
    const double allowed = 1e-3 * extent(target.positions);
    const std::vector<float> values = out.values();
    for (size_t k = 0; k < values.size(); ++k)
      promise(std::abs(double(values[k]) -
                       (applied.values == DD_VALUES_OFFSETS ? 0 : double(target.positions[k]))) <=
                  allowed,
              "onto itself a pose at rest comes back");
    Output refused_one(target.vertex_count());
    const dd_points odd_pose = counted(*pose.given(), bytes);
    const dd_points_out odd_out = counted(refused_one.get(), bytes);
    refused_one.after(dd_transfer_apply(transfer.get(), bytes.pointer(&odd_pose), with.get(),
                                        bytes.pointer(&odd_out)));
  }
  return 0;
}
