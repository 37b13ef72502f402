// SPDX-License-Identifier: GPL-3.0-or-later
// Calls that need no job: measures, distances, gradients, riders, defaults.
#include "checks.h"
#include "meshes.h"
#include "points.h"

using namespace dd::fuzz;

namespace {

double between(const std::vector<float>& positions, int32_t a, int32_t b) {
  double sum = 0;
  for (size_t c = 0; c < 3; ++c) {
    const double difference =
        double(positions[3 * size_t(a) + c]) - double(positions[3 * size_t(b) + c]);
    sum += difference * difference;
  }
  return std::sqrt(sum);
}

void distances(Bytes& bytes) {
  const Surface surface = any_surface(bytes);
  const size_t n = surface.vertex_count();
  std::vector<int32_t> sources(n, 0);
  for (int more = bytes.below(5); more > 0 && n > 0; --more)
    sources[bytes.seed() % n] = bytes.one_in(8) ? bytes.choice(3) : 1;
  std::vector<float> out(n, -7), before(out);
  const GivenMesh mesh(surface, bytes);
  const dd_status status =
      dd_mesh_distances(bytes.pointer(mesh.get()), bytes.pointer(sources.data()), bytes.count(n),
                        bytes.pointer(out.data()), bytes.count(n));
  promise(status != DD_OK || !mesh.misplaced(), "a stride that no points can have is refused");
  if (!well(status)) {
    promise(!bytes.tame(), "what is nothing out of the way is not refused");
    promise(out == before, "outputs are written only on DD_OK: distances were");
    return;
  }
  if (mesh.spread()) {
    const dd_mesh packed = surface.mesh();
    must(dd_mesh_distances(&packed, sources.data(), n, before.data(), n), "twice is once more");
    promise(out == before, "where points lie has no say in distances");
  }
  for (size_t v = 0; v < n; ++v) {
    promise(out[v] >= 0, "a distance is not negative, and a number");
    promise((sources[v] == 0) || out[v] == 0, "a source is at no distance");
  }
  for (size_t t = 0; t < surface.triangles.size(); t += 3)
    for (size_t k = 0; k < 3; ++k) {
      const int32_t a = surface.triangles[t + k], b = surface.triangles[t + (k + 1) % 3];
      const double reach = double(out[size_t(a)]) + between(surface.positions, a, b);
      promise(std::isfinite(out[size_t(a)]) == std::isfinite(out[size_t(b)]),
              "what can be reached is at a finite distance");
      promise(!std::isfinite(out[size_t(a)]) ||
                  out[size_t(b)] <= reach * (1 + 1e-5) + 1e-6 * extent(surface.positions),
              "along an edge it is no farther than the edge is long");
    }
}

void measures(Bytes& bytes) {
  const Surface surface = any_surface(bytes);
  const bool at_rest = bytes.one_in(3);
  const Points deformed(at_rest ? surface.positions : posed(surface.positions, bytes), bytes);
  Points base, deformed_base;
  auto options = usual<dd_measure_options>();
  const size_t n = surface.vertex_count();
  if (bytes.one_in(3)) {
    base = Points(posed(surface.positions, bytes), bytes);
    deformed_base = Points(posed(base.values(), bytes), bytes);
    *base.given() = counted(*base.given(), bytes);
    *deformed_base.given() = counted(*deformed_base.given(), bytes);
    options.base = bytes.pointer(base.given());
    options.deformed_base = bytes.pointer(deformed_base.given());
  }
  const Sized<dd_measure_options> how(options, bytes);
  const GivenMesh mesh(surface, bytes);
  dd_measures whole{};
  whole.struct_size = sizeof whole;
  const Sized<dd_measures> found(bytes.odd() ? dd_measures{} : whole, bytes);
  const dd_points now = counted(*deformed.given(), bytes);
  const dd_status status =
      dd_mesh_measure(bytes.pointer(mesh.get()), bytes.pointer(surface.roles.data()),
                      bytes.count(n), bytes.pointer(&now), how.get(), bytes.pointer(found.get()));
  const dd_measure_options known = how.known();
  promise(status != DD_OK || !(how.wrong() || mesh.misplaced() || deformed.misplaced() ||
                               (known.base && base.misplaced()) ||
                               (known.deformed_base && deformed_base.misplaced())),
          "a measure with a stride or a struct_size that is none is refused");
  if (!found.after(status)) {
    promise(!(bytes.tame() && surface.sound && at_rest),
            "what is nothing out of the way is not refused");
    return;
  }
  dd_measures m{}, again{};
  const size_t size = std::min<size_t>(sizeof m, found.get()->struct_size);
  std::memcpy(&m, found.get(), size);
  base.pack();
  deformed_base.pack();
  again.struct_size = m.struct_size;
  const dd_mesh packed = surface.mesh();
  const dd_points packed_now = deformed.packed();
  must(dd_mesh_measure(&packed, surface.roles.data(), n, &packed_now, how.get(), &again),
       "what was measured can be measured again");
  promise(std::memcmp(&m, &again, size) == 0, "where points lie has no say in measures");
  promise(m.intersecting_pairs >= 0 && m.new_intersecting_pairs >= 0 &&
              m.new_intersecting_pairs <= m.intersecting_pairs && m.intersecting_triangles >= 0 &&
              size_t(m.intersecting_triangles) <= surface.triangle_count(),
          "counts agree");
  promise(m.stretch >= 0 && m.normal_error >= 0 && m.normal_error <= 180.001,
          "measures are numbers that they can be");
  if (at_rest)
    promise(m.new_intersecting_pairs == 0 && m.stretch <= 1e-6, "at rest nothing is stretched");
}

void gradients(Bytes& bytes) {
  const Surface surface = any_surface(bytes);
  const size_t n = surface.vertex_count();
  const bool at_rest = bytes.one_in(3);
  const Points deformed(at_rest ? surface.positions : posed(surface.positions, bytes), bytes);
  std::vector<float> out(9 * n, -7), before(out);
  const GivenMesh mesh(surface, bytes);
  const dd_points now = counted(*deformed.given(), bytes);
  const dd_status status = dd_mesh_vertex_gradients(bytes.pointer(mesh.get()), bytes.pointer(&now),
                                                    bytes.pointer(out.data()), bytes.count(n));
  promise(status != DD_OK || !(mesh.misplaced() || deformed.misplaced()),
          "a stride that no points can have is refused");
  if (!well(status)) {
    promise(!(bytes.tame() && at_rest), "what is nothing out of the way is not refused");
    promise(out == before, "outputs are written only on DD_OK: gradients were");
    return;
  }
  if (mesh.spread() || deformed.spread()) {
    const dd_mesh packed = surface.mesh();
    const dd_points packed_now = deformed.packed();
    must(dd_mesh_vertex_gradients(&packed, &packed_now, before.data(), n), "twice is once more");
    promise(out == before, "where points lie has no say in gradients");
  }
  for (size_t k = 0; k < out.size(); ++k) {
    promise(std::isfinite(out[k]), "a gradient is finite");
    promise(!at_rest || std::abs(out[k] - float(k % 9 % 4 == 0)) < 1e-3, "none at rest is another");
  }
}

void riding(Bytes& bytes) {
  const Surface surface = any_surface(bytes);
  const int n = int(surface.vertex_count()), triangles = int(surface.triangle_count());
  const int groups = bytes.below(4);
  std::vector<int32_t> riders, contacts;
  std::vector<double> sizes;
  std::vector<char> rides(size_t(n), 0);
  bool sound = surface.sound;
  for (int g = 0; g < groups; ++g) {
    sizes.push_back(bytes.number(0, extent(surface.positions)));
    sound = sound && sizes.back() >= 0 && std::isfinite(sizes.back());
    int left = 1 + bytes.below(6);
    for (int more = left; more > 0 && triangles > 0; --more) {
      contacts.insert(contacts.end(), {g, bytes.below(triangles)});
      left = 0;
    }
    sound = sound && left == 0;
    for (int more = bytes.below(5); more > 0 && n > 0; --more) {
      const int vertex = bytes.below(n);
      if (!rides[size_t(vertex)] || bytes.odd()) riders.insert(riders.end(), {vertex, g});
      sound = sound && !rides[size_t(vertex)];
      rides[size_t(vertex)] = 1;
    }
  }
  if (!riders.empty() && bytes.odd())
    riders[bytes.seed() % riders.size()] = bytes.beyond(size_t(n));
  if (!contacts.empty() && bytes.odd())
    contacts[bytes.seed() % contacts.size()] = bytes.beyond(size_t(triangles));
  const auto is_beneath = [&](int vertex) {
    for (size_t i = 1; i < contacts.size(); i += 2)
      for (size_t k = 0; k < 3 && contacts[i] >= 0 && contacts[i] < triangles; ++k)
        if (surface.triangles[3 * size_t(contacts[i]) + k] == vertex) return true;
    return false;
  };
  for (size_t i = 0; i < riders.size(); i += 2) sound = sound && !is_beneath(riders[i]);
  auto options = usual<dd_riders_options>();
  options.threads = bytes.choice(1, 3);
  // Counts are what they say: there is nothing that a call could hold them against.
  options.riders = bytes.pointer(riders.data());
  options.rider_count = riders.size() / 2;
  options.contacts = bytes.pointer(contacts.data());
  options.contact_count = contacts.size() / 2;
  options.sizes = bytes.pointer(sizes.data());
  options.group_count = sizes.size();
  const Sized<dd_riders_options> how(options, bytes);
  const GivenMesh mesh(surface, bytes);
  dd_riders* made = nullptr;
  const dd_status status = dd_riders_make(bytes.pointer(mesh.get()), how.get(), &made);
  const Owned<dd_riders> owned(made);
  promise(status != DD_OK || !(how.wrong() || mesh.misplaced()),
          "riders with a stride or a struct_size that is none are refused");
  if (!well(status)) {
    promise(!made, "outputs are written only on DD_OK: riders were");
    promise(!(bytes.tame() && sound), "what is nothing out of the way is not refused");
    return;
  }
  const std::vector<float> now = posed(surface.positions, bytes);
  std::vector<float> differences;
  for (size_t k = 0; k < now.size(); ++k) differences.push_back(now[k] - surface.positions[k]);
  const Points offsets(differences, bytes);
  Output out(size_t(n), bytes);
  const dd_points_out room = out.get();
  const dd_points given = counted(*offsets.given(), bytes);
  const dd_points_out before = room;
  const std::vector<float> untouched = out.values();
  const dd_status placed =
      dd_riders_place(bytes.pointer(made), bytes.pointer(&given), bytes.pointer(&before));
  promise(placed != DD_OK || !(out.misplaced() || offsets.misplaced()),
          "a stride that no points can have is refused");
  const std::vector<float> after = out.values();
  if (!well(placed)) promise(after == untouched, "outputs are written only on DD_OK: offsets were");
  for (size_t v = 0; v < size_t(n) && placed == DD_OK; ++v)
    for (size_t k = 3 * v; k < 3 * v + 3; ++k)
      promise(rides[v] ? std::isfinite(after[k]) : after[k] == untouched[k],
              "what rides is placed, and nothing else");
}

/// Defaults for a caller that states any size, and has room for it.
template <class Options>
void defaults(Bytes& bytes) {
  size_t size = sizeof(Options);
  if (!bytes.one_in(3)) size = static_cast<size_t>(bytes.below(256));
  if (bytes.one_in(8)) size = 4097 + bytes.seed();
  constexpr unsigned char kUntouched = 0xa5;
  const std::unique_ptr<unsigned char, void (*)(void*)> room(
      static_cast<unsigned char*>(std::malloc(std::max<size_t>(1, size))), std::free);
  std::fill_n(room.get(), size, kUntouched);
  const bool fits = size >= sizeof(uint32_t) && size <= 4096;
  const bool filled = well(kInit<Options>(reinterpret_cast<Options*>(room.get()), size));
  promise(filled == fits, "defaults are for structs of a size that a struct can have");
  if (!filled) {
    promise(std::all_of(room.get(), room.get() + size,
                        [](unsigned char byte) { return byte == kUntouched; }),
            "outputs are written only on DD_OK: options were");
    return;
  }
  const auto whole = usual<Options>();
  uint32_t said = 0;
  std::memcpy(&said, room.get(), sizeof said);
  promise(said == size, "options say how large the caller has them");
  promise(std::memcmp(room.get() + sizeof said,
                      reinterpret_cast<const unsigned char*>(&whole) + sizeof said,
                      std::min(size, sizeof whole) - sizeof said) == 0,
          "an older or newer caller has the same defaults");
}

void defaults(Bytes& bytes) {
  switch (bytes.below(11)) {
    case 0:
      return defaults<dd_bind_options>(bytes);
    case 1:
      return defaults<dd_refinement_options>(bytes);
    case 2:
      return defaults<dd_normal_options>(bytes);
    case 3:
      return defaults<dd_volumes_options>(bytes);
    case 4:
      return defaults<dd_examples_options>(bytes);
    case 5:
      return defaults<dd_update_options>(bytes);
    case 6:
      return defaults<dd_transfer_options>(bytes);
    case 7:
      return defaults<dd_apply_options>(bytes);
    case 8:
      return defaults<dd_match_options>(bytes);
    case 9:
      return defaults<dd_riders_options>(bytes);
    default:
      return defaults<dd_measure_options>(bytes);
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Bytes bytes(data, size);
  switch (bytes.below(5)) {
    case 0:
      distances(bytes);
      break;
    case 1:
      measures(bytes);
      break;
    case 2:
      gradients(bytes);
      break;
    case 3:
      riding(bytes);
      break;
    default:
      defaults(bytes);
  }
  return 0;
}
