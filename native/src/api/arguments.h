// SPDX-License-Identifier: GPL-3.0-or-later
// Arguments of the C ABI: structs, arrays and their counts, checked and taken over.
#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "api/call.h"
#include "mesh/correspondence.h"
#include "mesh/mesh.h"
#include "support/similarity.h"

namespace dd::api {

// Counts are at most INT32_MAX / 16, so that derived sizes, which are small multiples, fit int32.
constexpr size_t kMostElements = static_cast<size_t>(std::numeric_limits<int32_t>::max()) / 16;

// Bytes. Safety: refuses a size that was never set. The largest struct has less than 200.
constexpr uint32_t kLargestStruct = 4096;

/// Reads a caller's struct: as many bytes as both sides know; the rest, or all of it where null is
/// given, has the defaults.
template <class Struct>
Struct read_struct(const Struct* given, const Struct& defaults, const char* name = "options") {
  Struct values = defaults;
  if (!given) return values;
  require(given->struct_size >= sizeof(uint32_t) && given->struct_size <= kLargestStruct,
          std::string(name) + ".struct_size is not set");
  std::memcpy(&values, given, std::min<size_t>(given->struct_size, sizeof(Struct)));
  return values;
}

/// Fills a caller's struct of that size with the defaults.
template <class Struct>
void init_struct(Struct* target, size_t size, Struct defaults) {
  require(target, "options is null");
  require(size >= sizeof(uint32_t) && size <= kLargestStruct, "size is no size of the options");
  defaults.struct_size = static_cast<uint32_t>(size);
  std::memset(target, 0, size);
  std::memcpy(target, &defaults, std::min(size, sizeof(Struct)));
}

/// Fills a caller's struct with as many bytes as it has room for.
template <class Struct>
void write_struct(const char* name, Struct* target, Struct values) {
  require(target, std::string(name) + " is null");
  const uint32_t room = target->struct_size;
  require(room >= sizeof(uint32_t) && room <= kLargestStruct,
          std::string(name) + ".struct_size is not set");
  values.struct_size = room;
  std::memcpy(target, &values, std::min<size_t>(room, sizeof(Struct)));
}

inline void require_between(const char* name, int64_t value, int64_t least, int64_t most) {
  require(value >= least && value <= most, std::string(name) + " is " + std::to_string(value) +
                                               ", not between " + std::to_string(least) + " and " +
                                               std::to_string(most) + "");
}

/// An option that is one of an enum's values, first to last.
template <class Enum>
Enum choice(const char* name, int32_t value, Enum last, Enum first = Enum{}) {
  require_between(name, value, static_cast<int32_t>(first), static_cast<int32_t>(last));
  return static_cast<Enum>(value);
}

/// A number of zero or more.
inline double weight(const char* name, double value) {
  require(value >= 0 && std::isfinite(value), std::string(name) + " must be zero or more");
  return value;
}
/// A fraction of a whole.
inline double fraction(const char* name, double value) {
  require(value >= 0 && value <= 1, std::string(name) + " must be between 0 and 1");
  return value;
}
inline int whole(const char* name, int32_t value, int32_t least, int32_t most) {
  require_between(name, value, least, most);
  return value;
}
inline bool yes_or_no(const char* name, int32_t value) { return whole(name, value, 0, 1) == 1; }

inline int threads(int32_t value) { return whole("options.threads", value, 1, 1024); }

/// An array of given things that must be as many as wanted; kind: what they are, "vertices".
template <class Value>
void require_count(const char* name, const Value* array, size_t given, size_t wanted,
                   const char* kind) {
  require(given == wanted, std::string(name) + " is for " + std::to_string(given) + " " + kind +
                               ", not " + std::to_string(wanted) + "");
  require(array || given == 0, std::string(name) + " is null");
}

/// The same of an array that may be left out. Returns whether it is there.
template <class Value>
bool is_given(const char* name, const Value* array, size_t given, size_t wanted, const char* kind) {
  if (!array && given == 0) return false;
  require_count(name, array, given, wanted, kind);
  return array != nullptr;
}

inline size_t count_of(int value) { return static_cast<size_t>(value); }

/// Points of a caller as they lie in memory: rows of three, of any stride.
template <class Float>
using Strided = Eigen::Map<Float, Eigen::Unaligned, Eigen::OuterStride<>>;
using FloatRows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

constexpr size_t kPointBytes = 3 * sizeof(float);

/// A caller's points as they lie in memory. Throws if the struct is malformed.
template <class Rows, class Points>
Strided<Rows> strided(const std::string& name, const Points& points) {
  require(points.first || points.count == 0, name + ".first is null");
  require(points.count < kMostElements, name + " has more points than can be numbered");
  require(points.count == 0 || (points.stride >= kPointBytes && points.stride <= kLargestStruct &&
                                points.stride % sizeof(float) == 0),
          name + ".stride is " + std::to_string(points.stride) +
              ", which is no multiple of 4 bytes from 12 to 4096");
  return {points.first, static_cast<Index>(points.count), 3,
          Eigen::OuterStride<>(static_cast<Index>(points.stride / sizeof(float)))};
}

/// The same of points that must be there and as many as wanted; kind: what they are of, "vertices".
template <class Rows, class Points>
Strided<Rows> strided(const std::string& name, const Points* points, size_t wanted,
                      const char* kind) {
  require(points, name + " is null");
  require(points->count == wanted, name + " is for " + std::to_string(points->count) + " " + kind +
                                       ", not " + std::to_string(wanted));
  return strided<Rows>(name, *points);
}

inline Positions read_positions(const std::string& name, const dd_points& points) {
  return strided<const FloatRows>(name, points).cast<double>();
}
inline Positions read_positions(const std::string& name, const dd_points* points, size_t wanted,
                                const char* kind = "vertices") {
  return strided<const FloatRows>(name, points, wanted, kind).cast<double>();
}

/// Points that may be left out: empty then.
inline Positions read_optional_positions(const std::string& name, const dd_points* points,
                                         size_t wanted, const char* kind = "vertices") {
  return points ? read_positions(name, points, wanted, kind) : Positions{};
}

/// Where a result goes.
inline Strided<FloatRows> result_points(const char* name, const dd_points_out* points,
                                        size_t wanted) {
  return strided<FloatRows>(name, points, wanted, "vertices");
}

/// values: 3×4, row-major.
inline Similarity read_similarity(const char* name, const double* values) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 4, Eigen::RowMajor>> matrix(values);
  Similarity read;
  const double volume = matrix.leftCols<3>().determinant();
  read.mirrored = volume < 0;
  read.scale = std::cbrt(std::abs(volume));
  read.rotation = matrix.leftCols<3>() / read.scale;
  read.shift = matrix.col(3);
  const Eigen::Matrix3d product = read.rotation.transpose() * read.rotation;
  // Safety: allows for matrices in single precision, as Blender's are (1e-7), and for decimals.
  require(matrix.allFinite() && read.scale > 0 && product.isIdentity(1e-4),
          std::string(name) + " is not a rotation or reflection with a scale and a shift");
  return read;
}

inline Mesh read_mesh(const char* name, const dd_mesh* mesh) {
  const std::string what = name;
  require(mesh, what + " is null");
  require(mesh->triangles || mesh->triangle_count == 0, what + ".triangles is null");
  require(mesh->triangle_count < kMostElements,
          what + " has more triangles than this library can number");
  return {
      read_positions(what + ".vertices", mesh->vertices),
      Eigen::Map<const Triangles>(mesh->triangles, static_cast<Index>(mesh->triangle_count), 3)};
}

inline std::vector<int> read_roles(const int32_t* roles, size_t given, size_t wanted) {
  require_count("roles", roles, given, wanted, "vertices");
  return std::vector<int>(roles, roles + given);
}

inline Pairs read_pairs(const char* name, const int32_t* values, size_t count) {
  require(values || count == 0, std::string(name) + " is null");
  require(count < kMostElements, std::string(name) + " has more pairs than can be numbered");
  Pairs pairs(count);
  for (size_t i = 0; i < count; ++i) pairs[i] = {values[2 * i], values[2 * i + 1]};
  return pairs;
}

/// Writes vertex indices to out; with capacity 0 only their count. Throws if capacity is too small.
inline void write_vertices(const std::vector<int>& vertices, int32_t* out, size_t capacity,
                           size_t* vertex_count) {
  require(vertex_count, "vertex_count is null");
  if (capacity > 0) {
    require(out, "out is null");
    require(capacity >= vertices.size(), "capacity is " + std::to_string(capacity) +
                                             ", but there are " + std::to_string(vertices.size()) +
                                             " vertices");
    std::copy(vertices.begin(), vertices.end(), out);
  }
  *vertex_count = vertices.size();
}

/// n×3 as floats; refuses what leaves their range.
template <class Target>
void write_floats(const Positions& values, Target&& out) {
  // The sum is NaN if an entry is; maxCoeff() may miss it.
  if (!(values.cwiseAbs().sum() >= 0) ||
      !(values.cwiseAbs().maxCoeff() < 0.5 * std::numeric_limits<float>::max()))
    throw motion_too_large();
  out = values.cast<float>();
}

}  // namespace dd::api
