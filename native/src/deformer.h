// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <vector>

#include "methods/transfer.h"
#include "progress.h"

namespace dd {

enum class BaseMetric { surface = 0, base = 1 };

struct BindOptions {
  BaseMetric base_metric = BaseMetric::surface;
  double metric_smoothing = 0;  ///< mean edge lengths; with BaseMetric::surface only
};

/// A surface with its region bound: all that is factored once, and the update that isn't.
class Deformer {
 public:
  /// mesh and roles as for validate() and split_region(). Throws Error.
  Deformer(Mesh mesh, const std::vector<int>& roles, int handle_count, const BindOptions& options,
           const Progress& progress = {});

  /// matrices: handle_count row-major 3×4 affine matrices, rest to present, in the mesh's units.
  /// Returns the displacement of every vertex, n×3, in the mesh's units; valid until the next call.
  /// Throws Error(argument) naming the handle when a matrix is not finite, Error(numeric) when the
  /// result isn't.
  const Positions& update(const double* matrices, bool rotation_only);

  const Mesh& mesh() const { return mesh_; }
  const Region& region() const { return region_; }
  const std::vector<int>& degenerate_triangles() const { return degenerate_; }
  int borrowed_count() const { return transfer_->borrowed_count(); }
  double bytes() const;

  /// B at rest and as of the last update, n×3, in the mesh's units.
  Positions base() const { return from_unit(base_); }
  Positions deformed_base() const;

 private:
  Positions from_unit(const Positions& unit) const;

  Mesh mesh_;
  Region region_;
  // Everything inside is solved in a box of diagonal 1 about the origin, so that no tolerance
  // anywhere depends on the user's unit or on how far from the origin the mesh was modelled.
  double scale_ = 1;
  Eigen::RowVector3d centre_ = Eigen::RowVector3d::Zero();
  std::vector<int> degenerate_;
  Positions base_;            // unit box
  Positions handle_centres_;  // the mesh's units
  std::unique_ptr<Transfer> transfer_;

  RowMatrix coefficients_;    // 4h×4
  RowMatrix handle_offsets_;  // one row of 4 for each of Region::handle_vertices, unit box
  Positions offsets_;
};

}  // namespace dd
