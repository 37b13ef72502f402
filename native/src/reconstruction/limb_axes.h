// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "reconstruction/factored_surface.h"

namespace dd {

/// Unit vectors along the limb at each active vertex, by active index: the direction in which
/// normals vary least around it, the last eigenvector of n nᵀ smoothed over a length of the limb's
/// thickness. Where none is distinguished, as on a sphere or a plane, it is any, mostly within the
/// surface. thicknesses: by active index; 0: no other side is near.
Positions limb_axes(const FactoredSurface& surface, const Eigen::VectorXd& thicknesses);

}  // namespace dd
