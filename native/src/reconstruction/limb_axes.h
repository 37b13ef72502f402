// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "reconstruction/factored_surface.h"

namespace dd {

/// Unit vectors along the limb at each active vertex, by active index: the direction in which
/// normals vary least in its neighbourhood, the last eigenvector of the sum of n nᵀ weighted by
/// area. Where none is distinguished, as on a sphere or a plane, it is any, mostly within the
/// surface.
Positions limb_axes(const FactoredSurface& surface);

}  // namespace dd
