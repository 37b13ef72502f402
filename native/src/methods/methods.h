// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>

#include "methods/method.h"

namespace dd {

/// What the rest of the library asks about a method. A new method is a file of its own, a value of
/// MethodKind and a row of this table.
struct MethodFacts {
  const char* name;  ///< as sentences have it
  bool slow;         ///< takes far longer than a frame
  bool in_steps;     ///< may approach a large motion by steps, each from the last one's result
  bool from_base;    ///< goes where a base from outside goes, but leaves the place of components
                     ///< that nothing holds open
  /// progress: of preparing a slow method, which is asked whether to go on.
  std::unique_ptr<Method> (*make)(BoundSurface& bound, const Progress& progress);
};

constexpr int kMethodCount = 6;

/// Throws Error(argument) for what is no method.
const MethodFacts& facts(MethodKind method);

}  // namespace dd
