// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: measures of a deformation, gradients at vertices, and distances.
#include "mesh/measures.h"

#include <algorithm>
#include <vector>

#include "api/arguments.h"
#include "api/defaults.h"
#include "mesh/geodesic_distances.h"
#include "mesh/vertex_gradients.h"

using namespace dd::api;

extern "C" {

dd_status dd_mesh_measure(const dd_mesh* mesh, const int32_t* roles, size_t role_count,
                          const dd_points* deformed, const dd_measure_options* options,
                          dd_measures* measures) {
  return guarded([&] {
    const dd::Mesh rest = read_mesh("mesh", mesh);
    dd::validate(rest);
    const size_t n = mesh->vertices.count;
    const dd::Mesh now = {read_positions("deformed", deformed, n), rest.triangles};
    dd::validate(now);
    std::vector<char> free;
    for (int role : read_roles(roles, role_count, n)) free.push_back(role == DD_ROLE_FREE);
    const dd_measure_options how = read_struct(options, measure_defaults());
    const dd::Positions base = read_optional_positions("options.base", how.base, n);
    const dd::Positions deformed_base =
        read_optional_positions("options.deformed_base", how.deformed_base, n);
    require(base.size() == deformed_base.size(),
            "options.base and options.deformed_base go together");
    require(base.allFinite(), "options.base has coordinates that are not finite");
    require(deformed_base.allFinite(), "options.deformed_base has coordinates that are not finite");
    const dd::Measures m = dd::measure(rest, now.positions, free, base, deformed_base);
    dd_measures found{};
    found.intersecting_pairs = m.intersecting_pairs;
    found.new_intersecting_pairs = m.new_intersecting_pairs;
    found.intersecting_triangles = m.intersecting_triangles;
    found.stretch = m.stretch;
    found.normal_error = m.normal_error;
    found.area_ratio = m.area_ratio;
    found.volume_ratio = m.volume_ratio;
    write_struct("measures", measures, found);
  });
}

dd_status dd_mesh_distances(const dd_mesh* mesh, const int32_t* sources, size_t source_count,
                            float* out, size_t out_count) {
  return guarded([&] {
    const dd::Mesh surface = read_mesh("mesh", mesh);
    dd::validate(surface);
    require_count("sources", sources, source_count, mesh->vertices.count, "vertices");
    require_count("out", out, out_count, mesh->vertices.count, "vertices");
    std::vector<char> is_source(source_count);
    for (size_t v = 0; v < source_count; ++v) is_source[v] = sources[v] != 0;
    const std::vector<double> distances = dd::geodesic_distances(surface, is_source);
    std::transform(distances.begin(), distances.end(), out,
                   [](double distance) { return static_cast<float>(distance); });
  });
}

dd_status dd_mesh_vertex_gradients(const dd_mesh* mesh, const dd_points* deformed, float* out,
                                   size_t out_count) {
  return guarded([&] {
    const dd::Mesh rest = read_mesh("mesh", mesh);
    dd::validate(rest);
    const size_t n = mesh->vertices.count;
    require_count("out", out, out_count, n, "vertices");
    const dd::Mesh now = {read_positions("deformed", deformed, n), rest.triangles};
    dd::validate(now);
    const dd::VertexGradients found = dd::vertex_gradients(rest, now.positions);
    std::transform(found.data(), found.data() + found.size(), out,
                   [](double value) { return static_cast<float>(value); });
  });
}

}  // extern "C"
