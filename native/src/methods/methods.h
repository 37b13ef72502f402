// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "methods/method.h"

namespace dd {

/// The properties of a method that the rest of the library depends on. A new method is a file of
/// its own, a value of MethodKind and a row of the table in methods.cpp.
struct MethodFacts {
  const char* name;  ///< for messages
  bool slow;         ///< an update takes far longer than a frame
  bool in_steps;     ///< may split a large motion into steps, each re-based on the last result
  bool from_base;    ///< follows a base from outside, but leaves the translation of components
                     ///< without constrained vertices open
  /// progress: called while a slow method prepares, so that it can be cancelled.
  std::unique_ptr<Method> (*make)(BoundSurface& bound, const Progress& progress);
};

constexpr int kMethodCount = 6;

/// Throws Error(argument) if there is no such method.
const MethodFacts& facts(MethodKind method);

}  // namespace dd
