// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: measures of a deformation, distances, and solids.
#include <memory>
#include <utility>
#include <vector>

#include "api/c_api_support.h"
#include "mesh/distances.h"
#include "mesh/measures.h"
#include "systems/tets.h"

using namespace dd::c_api;

struct dd_tets {
  dd::TetMesh mesh;
  std::vector<int> roles;
  int handle_count;
  std::unique_ptr<dd::TetPoisson> poisson;
};

extern "C" {

int32_t dd_measure(const float* rest, const float* deformed, size_t position_count,
                   const int32_t* triangles, size_t triangle_index_count, const int32_t* roles,
                   size_t role_count, const float* base, const float* deformed_base,
                   dd_measures* measures) {
  return guarded([&] {
    require(roles || role_count == 0, "roles is null.");
    const dd::Mesh mesh = read_mesh(rest, position_count, triangles, triangle_index_count);
    dd::validate(mesh);
    const dd::Mesh now = read_mesh(deformed, position_count, triangles, triangle_index_count);
    dd::validate(now);
    require_size("roles", role_count, position_count / 3);
    require(!base == !deformed_base, "base and deformed_base go together.");
    const size_t base_count = base ? position_count : 0;
    const dd::Positions from = read_base(base, base_count, position_count),
                        to = read_base(deformed_base, base_count, position_count);
    require(from.allFinite(), "base has coordinates that are not finite.");
    require(to.allFinite(), "deformed_base has coordinates that are not finite.");
    std::vector<char> free;
    for (size_t v = 0; v < role_count; ++v) free.push_back(roles[v] == DD_ROLE_FREE);
    const dd::Measures m = dd::measure(mesh, now.positions, free, from, to);
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

int32_t dd_distances(const float* positions, size_t position_count, const int32_t* triangles,
                     size_t triangle_index_count, const int32_t* sources, size_t source_count,
                     float* out, size_t out_count) {
  return guarded([&] {
    require(sources && out, "sources or out is null.");
    const dd::Mesh mesh = read_mesh(positions, position_count, triangles, triangle_index_count);
    dd::validate(mesh);
    require_size("sources", source_count, position_count / 3);
    require_size("out", out_count, position_count / 3);
    std::vector<char> is_source(source_count);
    for (size_t v = 0; v < source_count; ++v) is_source[v] = sources[v] != 0;
    const std::vector<double> distances = dd::surface_distances(mesh, is_source);
    std::transform(distances.begin(), distances.end(), out,
                   [](double distance) { return static_cast<float>(distance); });
  });
}

int32_t dd_tets_create(const double* positions, size_t position_count, const int32_t* tets,
                       size_t tet_index_count, const int32_t* roles, size_t role_count,
                       int32_t handle_count, dd_tets** result) {
  return guarded([&] {
    require(result, "result is null.");
    require(positions && tets && roles, "positions, tets or roles is null.");
    require(position_count % 3 == 0, "positions has not three elements a vertex.");
    require(tet_index_count % 4 == 0, "tets has not four elements a tetrahedron.");
    require_size("roles", role_count, position_count / 3);
    const size_t limit = static_cast<size_t>(std::numeric_limits<int32_t>::max()) / 16;
    require(position_count / 3 < limit && tet_index_count / 4 < limit,
            "The mesh has more vertices or tetrahedra than this library can number.");
    require(handle_count >= 0, "handle_count is negative.");
    dd::TetMesh mesh = {
        Eigen::Map<const dd::Positions>(positions, static_cast<Eigen::Index>(position_count / 3),
                                        3),
        Eigen::Map<const dd::Tetrahedra>(tets, static_cast<Eigen::Index>(tet_index_count / 4), 4)};
    dd::validate(mesh);
    std::vector<int> copy(roles, roles + role_count);
    auto poisson = std::make_unique<dd::TetPoisson>(mesh, copy, handle_count, dd::gradient(mesh),
                                                    dd::volumes(mesh));
    *result = new dd_tets{std::move(mesh), std::move(copy), handle_count, std::move(poisson)};
  });
}

int32_t dd_tets_get_operator(const dd_tets* tets, int32_t which, int32_t* rows, int32_t* columns,
                             double* values, size_t capacity, size_t* entry_count) {
  return guarded([&] {
    require(tets, "tets is null.");
    require(entry_count, "entry_count is null.");
    require(which >= DD_TETS_GRADIENT && which <= DD_TETS_LAPLACIAN,
            "which is " + std::to_string(which) + ", which is no operator.");
    const dd::SparseMatrix matrix = which == DD_TETS_GRADIENT ? tets->poisson->gradient_operator()
                                    : which == DD_TETS_LAPLACIAN
                                        ? tets->poisson->laplacian()
                                        : dd::deformation_operator(tets->mesh);
    const size_t entries = static_cast<size_t>(matrix.nonZeros());
    if (capacity > 0) {
      require(rows && columns && values, "rows, columns or values is null.");
      require(capacity >= entries, "capacity is " + std::to_string(capacity) + ", but there are " +
                                       std::to_string(entries) + " entries.");
      size_t k = 0;
      for (Eigen::Index column = 0; column < matrix.outerSize(); ++column)
        for (dd::SparseMatrix::InnerIterator it(matrix, column); it; ++it, ++k) {
          rows[k] = static_cast<int32_t>(it.row());
          columns[k] = static_cast<int32_t>(it.col());
          values[k] = it.value();
        }
    }
    *entry_count = entries;
  });
}

int32_t dd_tets_solve(const dd_tets* tets, const double* constrained, size_t constrained_count,
                      const double* gradients, size_t gradient_value_count, double* out,
                      size_t out_count) {
  return guarded([&] {
    require(tets && constrained && gradients && out,
            "tets, constrained, gradients or out is null.");
    const Eigen::Index n = tets->mesh.vertex_count(), m = tets->mesh.tet_count();
    require_size("constrained", constrained_count, static_cast<size_t>(3 * n));
    require_size("gradients", gradient_value_count, static_cast<size_t>(9 * m));
    require_size("out", out_count, static_cast<size_t>(3 * n));
    dd::RowMatrix transposed(3 * m, 3);
    for (Eigen::Index j = 0; j < m; ++j)
      transposed.middleRows<3>(3 * j) =
          Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(gradients + 9 * j)
              .transpose();
    const dd::Positions result =
        tets->poisson->solve(Eigen::Map<const dd::Positions>(constrained, n, 3), transposed);
    require(result.allFinite(), "The constrained positions or gradients are not finite.");
    Eigen::Map<dd::Positions>(out, n, 3) = result;
  });
}

int32_t dd_tets_update(const dd_tets* tets, const double* matrices, size_t matrix_value_count,
                       double* out, size_t out_count) {
  return guarded([&] {
    require(tets && matrices && out, "tets, matrices or out is null.");
    const Eigen::Index n = tets->mesh.vertex_count();
    require_size("matrices", matrix_value_count, 12 * static_cast<size_t>(tets->handle_count));
    require_size("out", out_count, static_cast<size_t>(3 * n));
    Eigen::Map<dd::Positions>(out, n, 3) = dd::edit_by_gradients(
        *tets->poisson, tets->mesh, tets->roles, tets->handle_count, matrices);
  });
}

void dd_tets_free(dd_tets* tets) { delete tets; }

}  // extern "C"
