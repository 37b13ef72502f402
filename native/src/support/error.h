// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace dd {

/// The values are those of dd_status in the public header.
enum class Status { ok = 0, argument, mesh, region, numeric, memory, cancelled, busy, internal };

/// What an error is about: the values of dd_subject, and its index.
struct Subject {
  enum Kind {
    none = 0,
    vertex,
    triangle,
    handle,
    example,
    pair,
    source_vertex,
    source_triangle,
    target_vertex,
    target_triangle,
    base_vertex,
    base_triangle,
  };
  Kind kind = none;
  int64_t index = -1;
};

/// What can be done about an error: the values of dd_remedy.
enum class Remedy {
  none = 0,
  call,
  wait,
  free_resources,
  validate_mesh,
  move_vertex,
  add_faces,
  dissolve_faces,
  add_handle,
  assign_vertices,
  handle_on_part,
  free_vertices,
  fix_vertices,
  move_less,
  smooth_metric_less,
  surface_metric,
  pin_fewer,
  whole_gradients,
  match_meshes,
  move_target,
  correct_markers,
  same_vertices,
};

/// Whatever the core refuses, for programs and for people.
class Error : public std::runtime_error {
 public:
  /// message: a sentence, or with a subject the rest of one that begins with its name ("has no
  /// vertices"); without its full stop and without the remedy. vertices: all that the error is
  /// about, where it names one of them.
  Error(Status status, const std::string& message, Remedy remedy = Remedy::none,
        std::vector<int> vertices = {})
      : Error(status, Subject{}, message, remedy, std::move(vertices)) {}
  Error(Status status, Subject subject, const std::string& message, Remedy remedy,
        std::vector<int> vertices = {});

  /// This error with a subject vertex or triangle changed to target_vertex or target_triangle.
  Error of_target() const {
    Subject subject = facts_->subject;
    if (subject.kind == Subject::vertex) subject.kind = Subject::target_vertex;
    if (subject.kind == Subject::triangle) subject.kind = Subject::target_triangle;
    return {status_, subject, facts_->message, facts_->remedy, facts_->vertices};
  }

  Status status() const { return status_; }
  Subject subject() const { return facts_->subject; }
  Remedy remedy() const { return facts_->remedy; }
  const std::string& message() const { return facts_->message; }
  const std::vector<int>& vertices() const { return facts_->vertices; }
  // what(): subject, message and remedy as one English sentence.

 private:
  struct Facts {
    Subject subject;
    Remedy remedy;
    std::string message;
    std::vector<int> vertices;
  };
  Status status_;
  std::shared_ptr<const Facts> facts_;  // shared: copying an exception must not throw
};

/// Refuses a call that is wrong by itself; message: without its full stop.
inline void require(bool condition, const std::string& message) {
  if (!condition) throw Error(Status::argument, message, Remedy::call);
}
/// The same of fixed text, which costs nothing where there is nothing to refuse.
inline void require(bool condition, const char* message) {
  if (!condition) throw Error(Status::argument, message, Remedy::call);
}

/// The error for a result beyond the range of single precision.
inline Error leaves_single_precision() {
  return {Status::numeric,
          "The handles' matrices are too large: the deformed surface leaves the range of single "
          "precision",
          Remedy::move_less};
}

/// The same where it is no handle that moves too far.
inline Error motion_too_large() {
  return {Status::numeric,
          "The motion is too large: the surface leaves the range of single precision",
          Remedy::move_less};
}

}  // namespace dd
