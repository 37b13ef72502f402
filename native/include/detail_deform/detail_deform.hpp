// SPDX-License-Identifier: GPL-3.0-or-later

// Detail Deform in C++17: what detail_deform.h offers, with owners that release what they hold and
// exceptions in place of statuses. Header-only; nothing of it is in the library's ABI.
//
//   detail_deform::Mesh mesh{positions, triangles};
//   detail_deform::Deformer deformer = detail_deform::bind(mesh, roles, handle_count);
//   deformer.update(matrices, result);
#ifndef DETAIL_DEFORM_HPP
#define DETAIL_DEFORM_HPP

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <utility>
#include <vector>

#include "detail_deform/detail_deform.h"

namespace detail_deform {

/// A call that did not return DD_OK: what() is dd_last_message(), the rest is of dd_error.
class Error : public std::runtime_error {
 public:
  explicit Error(const dd_error& told)
      : std::runtime_error(dd_last_message()),
        status(told.status),
        subject(told.subject),
        remedy(told.remedy),
        index(told.index) {}

  dd_status status;
  dd_subject subject;
  dd_remedy remedy;
  std::int64_t index;  ///< of the subject, or -1
};

/// Throws Error unless the status is DD_OK.
inline void check(dd_status status) {
  if (status == DD_OK) return;
  dd_error told{};
  told.struct_size = sizeof told;
  dd_last_error(&told);
  throw Error(told);
}

/// Options with the library's defaults: defaults(dd_bind_options_init).
template <class Options>
Options defaults(dd_status (*init)(Options*, size_t)) {
  Options options;
  check(init(&options, sizeof options));
  return options;
}

/// Three consecutive floats a point.
inline dd_points points(const std::vector<float>& values) {
  return {values.data(), values.size() / 3, 3 * sizeof(float)};
}
inline dd_points_out points_out(std::vector<float>& values) {
  return {values.data(), values.size() / 3, 3 * sizeof(float)};
}

/// A triangle mesh: three floats a vertex, three vertex numbers a triangle.
struct Mesh {
  std::vector<float> positions;
  std::vector<std::int32_t> triangles;

  dd_mesh view() const { return {points(positions), triangles.data(), triangles.size() / 3}; }
};

struct Release {
  void operator()(dd_job* job) const { dd_job_free(job); }
  void operator()(dd_deformer* deformer) const { dd_deformer_free(deformer); }
  void operator()(dd_transfer* transfer) const { dd_transfer_free(transfer); }
  void operator()(dd_match* match) const { dd_match_free(match); }
};
template <class Object>
using Owner = std::unique_ptr<Object, Release>;

/// What a job makes, waited for. take: dd_job_take_deformer and so on.
template <class Object>
Owner<Object> result(dd_job* job, dd_status (*take)(dd_job*, Object**)) {
  Object* made = nullptr;
  check(take(job, &made));
  return Owner<Object>(made);
}

/// A bound surface. One thread at a time.
class Deformer {
 public:
  explicit Deformer(Owner<dd_deformer> bound) : bound_(std::move(bound)) {}

  /// matrices: twelve numbers a handle, row-major 3x4, rest to present. result: resized.
  void update(const std::vector<double>& matrices, std::vector<float>& result,
              const dd_update_options* options = nullptr) {
    result.resize(3 * static_cast<size_t>(info().vertex_count));
    const dd_points_out out = points_out(result);
    check(dd_deformer_update(bound_.get(), matrices.data(), matrices.size() / 12, options, &out));
  }

  dd_deformer_info info() const {
    dd_deformer_info facts{};
    facts.struct_size = sizeof facts;
    check(dd_deformer_get_info(bound_.get(), &facts));
    return facts;
  }

  /// For the calls that have no member here.
  dd_deformer* get() const { return bound_.get(); }

 private:
  Owner<dd_deformer> bound_;
};

/// Binds, and waits for it. roles: a dd_role or the number of a handle for each vertex.
inline Deformer bind(const Mesh& mesh, const std::vector<std::int32_t>& roles, int handle_count,
                     const dd_bind_options* options = nullptr) {
  const dd_mesh view = mesh.view();
  dd_job* started = nullptr;
  check(dd_deformer_bind_start(&view, roles.data(), roles.size(), handle_count, options, &started));
  const Owner<dd_job> job(started);
  return Deformer(result(job.get(), dd_job_take_deformer));
}

/// A source and a target, factored. One thread at a time.
class Transfer {
 public:
  /// Of meshes of the same topology, or by pairs of triangles, source and target.
  Transfer(const Mesh& source, const Mesh& target, const std::vector<std::int32_t>& pairs = {},
           const dd_transfer_options* options = nullptr)
      : target_vertices_(target.positions.size()) {
    const dd_mesh from = source.view(), to = target.view();
    dd_job* started = nullptr;
    check(dd_transfer_start(&from, &to, pairs.empty() ? nullptr : pairs.data(), pairs.size() / 2,
                            options, &started));
    const Owner<dd_job> job(started);
    factored_ = result(job.get(), dd_job_take_transfer);
  }

  /// pose: the source's vertices, deformed. Returns the target's.
  std::vector<float> apply(const std::vector<float>& pose,
                           const dd_apply_options* options = nullptr) {
    std::vector<float> found(target_vertices_);
    const dd_points posed = points(pose);
    const dd_points_out out = points_out(found);
    check(dd_transfer_apply(factored_.get(), &posed, options, &out));
    return found;
  }

  dd_transfer* get() const { return factored_.get(); }

 private:
  size_t target_vertices_;  // numbers
  Owner<dd_transfer> factored_;
};

}  // namespace detail_deform

#endif
