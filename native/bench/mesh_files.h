// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <sstream>
#include <stdexcept>
#include <string>

#include "mesh/mesh.h"

namespace dd::bench {

/// A file that can't be read or makes no sense.
class UnreadableFile : public std::runtime_error {
 public:
  explicit UnreadableFile(const std::string& path) : std::runtime_error("Can't be read: " + path) {}
};

/// All of a file but lines that begin with #. Throws UnreadableFile.
std::stringstream text_of(const std::string& path);

/// The mesh of a .off or .obj file, its polygons cut into fans. Throws UnreadableFile, also where
/// the file ends too early, or the Error of validate().
Mesh mesh_from_file(const std::string& path);

}  // namespace dd::bench
