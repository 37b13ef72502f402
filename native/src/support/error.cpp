// SPDX-License-Identifier: GPL-3.0-or-later
#include "support/error.h"

namespace dd {

namespace {

std::string name(Subject subject) {
  const std::string number = std::to_string(subject.index);
  switch (subject.kind) {
    case Subject::none:
      return "";
    case Subject::vertex:
      return "Vertex " + number;
    case Subject::triangle:
      return "Triangle " + number;
    case Subject::handle:
      return "Handle " + number;
    case Subject::example:
      return "Example " + number;
    case Subject::pair:
      return "Pair " + number;
    case Subject::source_vertex:
      return "Vertex " + number + " of the source";
    case Subject::source_triangle:
      return "Triangle " + number + " of the source";
    case Subject::target_vertex:
      return "Vertex " + number + " of the target";
    case Subject::target_triangle:
      return "Triangle " + number + " of the target";
    case Subject::base_vertex:
      return "Vertex " + number + " of the base";
    case Subject::base_triangle:
      return "Triangle " + number + " of the base";
  }
  return "";
}

const char* advice(Remedy remedy) {
  switch (remedy) {
    case Remedy::none:
    case Remedy::call:
    case Remedy::wait:
      return "";  // the message says it
    case Remedy::free_resources:
      return "close other programs, or allow this one more memory and threads";
    case Remedy::validate_mesh:
      return "validate the mesh";
    case Remedy::move_vertex:
      return "delete or move that vertex";
    case Remedy::add_faces:
      return "the method works on surfaces, add faces";
    case Remedy::dissolve_faces:
      return "merge doubled vertices and dissolve degenerate faces there, add a handle, or leave "
             "that part out of the region";
    case Remedy::add_handle:
      return "add at least one that moves some vertices";
    case Remedy::assign_vertices:
      return "give it at least one";
    case Remedy::handle_on_part:
      return "put a handle on the part that should deform";
    case Remedy::free_vertices:
      return "make the region larger, or give the handles fewer vertices";
    case Remedy::fix_vertices:
      return "fix some vertices";
    case Remedy::move_less:
      return "move it less far";
    case Remedy::smooth_metric_less:
      return "lower metric_smoothing";
    case Remedy::surface_metric:
      return "measure on the surface, or hold that part by one more handle";
    case Remedy::pin_fewer:
      return "pin fewer";
    case Remedy::whole_gradients:
      return "transfer these, or place components or parts";
    case Remedy::match_meshes:
      return "give pairs, or match the meshes";
    case Remedy::move_target:
      return "bring the target nearer to the source";
    case Remedy::correct_markers:
      return "take one of them away";
    case Remedy::same_vertices:
      return "use a copy of the mesh with the same vertices";
  }
  return "";
}

std::string sentence(Subject subject, const std::string& message, Remedy remedy) {
  std::string text = name(subject);
  if (!text.empty()) text += " ";
  text += message;
  if (const std::string what_to_do = advice(remedy); !what_to_do.empty()) text += ": " + what_to_do;
  return text + ".";
}

}  // namespace

Error::Error(Status status, Subject subject, const std::string& message, Remedy remedy,
             std::vector<int> vertices)
    : std::runtime_error(sentence(subject, message, remedy)),
      status_(status),
      facts_(std::make_shared<const Facts>(Facts{subject, remedy, message, std::move(vertices)})) {}

}  // namespace dd
