// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <string>
#include <vector>

#include "cases.h"

namespace dd::bench {

/// The survey's own meshes and handles from a folder with plane, cylinder, bar and cactus, each as
/// .off (the surface), .sel (a number a vertex: 0 fixed, 1 free, 2 of the handle) and .def (the
/// handle's 4×4 matrix); lines that begin with # are comments. Throws std::runtime_error naming the
/// file that is missing or makes no sense.
std::vector<test::Case> survey_from_files(const std::string& folder);

}  // namespace dd::bench
