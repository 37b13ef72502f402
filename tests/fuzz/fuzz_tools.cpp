// SPDX-License-Identifier: GPL-3.0-or-later
// What is done at once and leaves nothing: measures, distances, gradients, and solids.
#include "checks.h"
#include "meshes.h"

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
  const dd_mesh mesh = surface.mesh();
  if (!well(dd_distances(bytes.pointer(&mesh), bytes.pointer(sources.data()), bytes.count(n),
                         bytes.pointer(out.data()), bytes.count(n)))) {
    promise(!bytes.tame(), "what is nothing out of the way is not refused");
    promise(out == before, "outputs are written only on DD_OK: distances were");
    return;
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
  const std::vector<float> deformed = at_rest ? surface.positions : posed(surface.positions, bytes);
  std::vector<float> base, deformed_base;
  dd_measure_options options{};
  options.struct_size = sizeof options;
  const size_t n = surface.vertex_count();
  if (bytes.one_in(3)) {
    base = posed(surface.positions, bytes);
    deformed_base = posed(base, bytes);
    options.base = bytes.pointer(base.data());
    options.deformed_base = bytes.pointer(deformed_base.data());
    options.base_count = bytes.count(n);
    options.deformed_base_count = bytes.count(n);
  }
  const Sized<dd_measure_options> how(options, bytes);
  const dd_mesh mesh = surface.mesh();
  dd_measures whole{};
  whole.struct_size = sizeof whole;
  const Sized<dd_measures> found(bytes.odd() ? dd_measures{} : whole, bytes);
  const int32_t status = dd_measure(bytes.pointer(&mesh), bytes.pointer(surface.roles.data()),
                                    bytes.count(n), bytes.pointer(deformed.data()), bytes.count(n),
                                    how.get(), bytes.pointer(found.get()));
  if (!found.after(status)) {
    promise(!(bytes.tame() && surface.sound && at_rest),
            "what is nothing out of the way is not refused");
    return;
  }
  dd_measures m{};
  std::memcpy(&m, found.get(), std::min<size_t>(sizeof m, found.get()->struct_size));
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
  const std::vector<float> deformed = at_rest ? surface.positions : posed(surface.positions, bytes);
  std::vector<float> out(9 * n, -7), before(out);
  const dd_mesh mesh = surface.mesh();
  if (!well(dd_vertex_gradients(bytes.pointer(&mesh), bytes.pointer(deformed.data()),
                                bytes.count(n), bytes.pointer(out.data()), bytes.count(n)))) {
    promise(!(bytes.tame() && at_rest), "what is nothing out of the way is not refused");
    promise(out == before, "outputs are written only on DD_OK: gradients were");
    return;
  }
  for (size_t k = 0; k < out.size(); ++k) {
    promise(std::isfinite(out[k]), "a gradient is finite");
    promise(!at_rest || std::abs(out[k] - float(k % 9 % 4 == 0)) < 1e-3, "none at rest is another");
  }
}

void solids(Bytes& bytes) {
  const Solid solid = any_solid(bytes);
  const size_t n = solid.vertex_count(), m = solid.tet_count();
  std::vector<int32_t> roles(n, DD_ROLE_FREE);
  int32_t handles = 1 + bytes.below(2);
  for (size_t v = 0; v < n; ++v) {
    const double z = solid.positions[3 * v + 2], x = solid.positions[3 * v];
    if (bytes.one_in(5)) roles[v] = z > x ? DD_ROLE_FIXED : bytes.below(handles);
  }
  if (n > 0) roles[0] = 0;
  if (bytes.odd() && n > 0) roles[bytes.seed() % n] = bytes.role();
  if (bytes.odd()) handles = bytes.choice(3);
  const dd_tet_mesh mesh = {solid.positions.data(), n, solid.tets.data(), m};
  dd_tets* created = nullptr;
  const int32_t status = dd_tets_create(bytes.pointer(&mesh), bytes.pointer(roles.data()),
                                        bytes.count(n), handles, bytes.pointer(&created));
  const Owned<dd_tets> tets(created);
  if (!well(status)) {
    promise(!tets, "outputs are written only on DD_OK: a solid was");
    return;
  }
  for (int32_t which : {DD_TETS_GRADIENT, DD_TETS_DEFORMATION_GRADIENT, DD_TETS_LAPLACIAN}) {
    size_t count = 0;
    must(dd_tets_get_operator(tets.get(), which, nullptr, nullptr, nullptr, 0, &count),
         "entries can be counted");
    std::vector<int32_t> rows(count), columns(count);
    std::vector<double> values(count);
    must(dd_tets_get_operator(tets.get(), which, rows.data(), columns.data(), values.data(), count,
                              &count),
         "entries can be asked for");
    const size_t height = which == DD_TETS_LAPLACIAN ? n : 3 * m;
    for (size_t k = 0; k < count; ++k)
      promise(rows[k] >= 0 && size_t(rows[k]) < height && columns[k] >= 0 &&
                  size_t(columns[k]) < n && std::isfinite(values[k]),
              "an entry is one of the operator's");
  }
  std::vector<double> gradients(9 * m), matrices;
  for (size_t j = 0; j < m; ++j)
    for (size_t k = 0; k < 9; ++k)
      gradients[9 * j + k] = k % 4 == 0 ? 1 : bytes.odd(64) ? bytes.any() : 0.1;
  Output<double> solved(n), moved(n);
  if (solved.after(dd_tets_solve(tets.get(), solid.positions.data(), bytes.count(n),
                                 bytes.pointer(gradients.data()), bytes.count(m),
                                 bytes.pointer(solved.data()), bytes.count(n))))
    for (size_t v = 0; v < n; ++v)
      if (roles[v] != DD_ROLE_FREE)
        promise(std::equal(solved.at(v), solved.at(v) + 3, &solid.positions[3 * v]),
                "what is constrained stays");
  for (int32_t h = 0; h < handles; ++h) {
    const double angle = bytes.number(-3, 3), shift = bytes.number(-2, 2);
    const double c = std::cos(angle), s = std::sin(angle);
    matrices.insert(matrices.end(), {c, -s, 0, shift, s, c, 0, 0, 0, 0, bytes.number(0, 2), 0});
  }
  moved.after(dd_tets_update(tets.get(), bytes.pointer(matrices.data()),
                             bytes.count(matrices.size() / 12), bytes.pointer(moved.data()),
                             bytes.count(n)));
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Bytes bytes(data, size);
  switch (bytes.below(4)) {
    case 0:
      distances(bytes);
      break;
    case 1:
      measures(bytes);
      break;
    case 2:
      gradients(bytes);
      break;
    default:
      solids(bytes);
  }
  return 0;
}
