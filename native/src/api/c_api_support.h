// SPDX-License-Identifier: GPL-3.0-or-later
// What the functions of the C ABI share: argument checks, exceptions turned into status.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdio>
#include <cstring>
#include <limits>
#include <new>
#include <string>
#include <vector>

#include "detail_deform/detail_deform.h"
#include "mesh/mesh.h"
#include "support/error.h"

namespace dd::c_api {

// A plain array: it needs no destructor at thread exit, which the library might not live to see.
inline thread_local char last_message[1024] = "";

inline void remember(const char* sentence) {
  std::snprintf(last_message, sizeof last_message, "%s", sentence);
}

/// Runs the body of a C function; whatever it throws becomes a status and a sentence.
template <class Body>
int32_t guarded(Body&& body) noexcept {
  try {
    body();
    return DD_OK;
  } catch (const Error& error) {
    remember(error.what());
    return static_cast<int32_t>(error.status());
  } catch (const std::bad_alloc&) {
    remember("There is not enough memory for a mesh of this size.");
    return DD_ERROR_MEMORY;
  } catch (const std::exception& error) {
    remember(error.what());
    return DD_ERROR_INTERNAL;
  } catch (...) {
    remember("An unknown error occurred.");
    return DD_ERROR_INTERNAL;
  }
}

inline void require(bool condition, const std::string& sentence) {
  if (!condition) throw Error(Status::argument, sentence);
}

inline void require_size(const char* name, size_t given, size_t wanted) {
  require(given == wanted, std::string(name) + " has " + std::to_string(given) + " elements, not " +
                               std::to_string(wanted) + ".");
}

/// Reads a caller's struct: as many bytes as both sides know, the rest stays at its default.
template <class Struct>
Struct read_struct(const char* name, const Struct* given, Struct defaults) {
  if (!given) return defaults;
  require(given->struct_size >= sizeof(uint32_t) && given->struct_size <= 4096,
          std::string(name) + ".struct_size is not set.");
  std::memcpy(&defaults, given, std::min<size_t>(given->struct_size, sizeof(Struct)));
  return defaults;
}

/// Fills a caller's struct with as many bytes as it has room for.
template <class Struct>
void write_struct(const char* name, Struct* target, Struct values) {
  require(target, std::string(name) + " is null.");
  const uint32_t room = target->struct_size;
  require(room >= sizeof(uint32_t) && room <= 4096, std::string(name) + ".struct_size is not set.");
  values.struct_size = room;
  std::memcpy(target, &values, std::min<size_t>(room, sizeof(Struct)));
}

using FloatRows = Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>;

inline Mesh read_mesh(const float* positions, size_t position_count, const int32_t* triangles,
                      size_t index_count) {
  require(positions || position_count == 0, "positions is null.");
  require(triangles || index_count == 0, "triangles is null.");
  require(position_count % 3 == 0, "positions has " + std::to_string(position_count) +
                                       " elements, which is not three a vertex.");
  require(index_count % 3 == 0, "triangles has " + std::to_string(index_count) +
                                    " elements, which is not three a triangle.");
  const size_t limit = static_cast<size_t>(std::numeric_limits<int32_t>::max()) / 16;
  require(position_count / 3 < limit && index_count / 3 < limit,
          "The mesh has more vertices or triangles than this library can number.");
  using IntRows = Eigen::Matrix<int32_t, Eigen::Dynamic, 3, Eigen::RowMajor>;
  return {Eigen::Map<const FloatRows>(positions, static_cast<Eigen::Index>(position_count / 3), 3)
              .cast<double>(),
          Eigen::Map<const IntRows>(triangles, static_cast<Eigen::Index>(index_count / 3), 3)};
}

/// n×3 floats as positions; empty when null and not of any length.
inline Positions read_base(const float* base, size_t count, size_t wanted) {
  if (!base) {
    require(count == 0, "options.base is null, but options.base_count is not 0.");
    return {};
  }
  require_size("options.base", count, wanted);
  return Eigen::Map<const FloatRows>(base, static_cast<Eigen::Index>(count / 3), 3).cast<double>();
}

/// Marks an object as in use for the length of a call.
class InUse {
 public:
  InUse(std::atomic<bool>& flag, const char* what) : flag_(flag) {
    if (flag_.exchange(true))
      throw Error(Status::busy, std::string("This ") + what + " is in use by another thread.");
  }
  ~InUse() { flag_ = false; }
  InUse(const InUse&) = delete;
  InUse& operator=(const InUse&) = delete;

 private:
  std::atomic<bool>& flag_;
};

/// The examples of a bind, each n×3.
inline std::vector<Positions> read_examples(const dd_bind_options& options, size_t position_count) {
  const int32_t count = options.example_count;
  require(count >= 0 && count <= 1000,
          "options.example_count is " + std::to_string(count) + ", not between 0 and 1000.");
  require(options.examples || count == 0,
          "options.examples is null, but options.example_count is " + std::to_string(count) + ".");
  require_size("options.examples", options.example_value_count,
               position_count * static_cast<size_t>(count));
  std::vector<Positions> examples;
  for (size_t i = 0; i < static_cast<size_t>(count); ++i)
    examples.push_back(
        read_base(options.examples + i * position_count, position_count, position_count));
  return examples;
}

}  // namespace dd::c_api
