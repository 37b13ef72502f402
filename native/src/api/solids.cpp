// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: solids.
#include <memory>
#include <utility>
#include <vector>

#include "api/arguments.h"
#include "systems/tets.h"

using namespace dd::api;

struct dd_tets {
  dd::TetMesh mesh;
  std::vector<int> roles;
  int handle_count;
  std::unique_ptr<dd::TetPoisson> poisson;
};

namespace {

dd::TetMesh read_tet_mesh(const dd_tet_mesh* mesh) {
  require(mesh, "mesh is null.");
  require(mesh->positions || mesh->vertex_count == 0, "mesh.positions is null.");
  require(mesh->tets || mesh->tet_count == 0, "mesh.tets is null.");
  require(mesh->vertex_count < kMostElements && mesh->tet_count < kMostElements,
          "mesh has more vertices or tetrahedra than this library can number.");
  return {
      Eigen::Map<const dd::Positions>(mesh->positions,
                                      static_cast<Eigen::Index>(mesh->vertex_count), 3),
      Eigen::Map<const dd::Tetrahedra>(mesh->tets, static_cast<Eigen::Index>(mesh->tet_count), 4)};
}

}  // namespace

extern "C" {

int32_t dd_tets_create(const dd_tet_mesh* mesh, const int32_t* roles, size_t role_count,
                       int32_t handle_count, dd_tets** tets) {
  return guarded([&] {
    require(tets, "tets is null.");
    require(handle_count >= 0, "handle_count is negative.");
    auto made = std::make_unique<dd_tets>();
    made->mesh = read_tet_mesh(mesh);
    made->roles = read_roles(roles, role_count, mesh->vertex_count);
    made->handle_count = handle_count;
    dd::validate(made->mesh);
    made->poisson = std::make_unique<dd::TetPoisson>(
        made->mesh, made->roles, handle_count, dd::gradient(made->mesh), dd::volumes(made->mesh));
    *tets = made.release();
  });
}

int32_t dd_tets_get_operator(const dd_tets* tets, int32_t which, int32_t* rows, int32_t* columns,
                             double* values, size_t capacity, size_t* entry_count) {
  return guarded([&] {
    require(tets, "tets is null.");
    require(entry_count, "entry_count is null.");
    require_between("which", which, DD_TETS_GRADIENT, DD_TETS_LAPLACIAN);
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
                      const double* gradients, size_t gradient_count, double* out,
                      size_t out_count) {
  return guarded([&] {
    require(tets, "tets is null.");
    const Eigen::Index n = tets->mesh.vertex_count(), m = tets->mesh.tet_count();
    require_count("constrained", constrained, constrained_count, static_cast<size_t>(n),
                  "vertices");
    require_count("gradients", gradients, gradient_count, static_cast<size_t>(m), "tetrahedra");
    require_count("out", out, out_count, static_cast<size_t>(n), "vertices");
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

int32_t dd_tets_update(const dd_tets* tets, const double* matrices, size_t matrix_count,
                       double* out, size_t out_count) {
  return guarded([&] {
    require(tets, "tets is null.");
    const Eigen::Index n = tets->mesh.vertex_count();
    require_count("matrices", matrices, matrix_count, count_of(tets->handle_count), "handles");
    require_count("out", out, out_count, static_cast<size_t>(n), "vertices");
    Eigen::Map<dd::Positions>(out, n, 3) = dd::edit_by_gradients(
        *tets->poisson, tets->mesh, tets->roles, tets->handle_count, matrices);
  });
}

void dd_tets_free(dd_tets* tets) { delete tets; }

}  // extern "C"
