// SPDX-License-Identifier: GPL-3.0-or-later
#include "methods/methods.h"

#include <iterator>
#include <string>

#include "methods/detail.h"
#include "methods/displacement_volumes.h"
#include "methods/examples/examples.h"
#include "methods/gradient_editing.h"
#include "methods/normal_displacement.h"
#include "methods/variational.h"

namespace dd {

namespace {

template <class Kind>
std::unique_ptr<Method> make(BoundSurface& bound, const Progress&) {
  return std::make_unique<Kind>(bound);
}
std::unique_ptr<Method> make_volumes(BoundSurface& bound, const Progress& progress) {
  return std::make_unique<DisplacementVolumes>(bound, progress);
}
std::unique_ptr<Method> make_posing(BoundSurface& bound, const Progress&) {
  return make_examples(bound);
}

// By MethodKind:           name                   slow   steps  base
constexpr MethodFacts kMethods[] = {
    {"detail transfer", false, true, true, make<Detail>},
    {"smooth displacement", false, true, false, make<Variational>},
    {"normal displacement", false, true, false, make<NormalDisplacement>},
    {"gradient editing", false, true, true, make<GradientEditing>},
    {"displacement volumes", true, true, false, make_volumes},
    {"posing by example", false, false, false, make_posing}};
static_assert(std::size(kMethods) == kMethodCount);

}  // namespace

const MethodFacts& facts(MethodKind method) {
  const int index = static_cast<int>(method);
  if (index < 0 || index >= kMethodCount)
    throw Error(Status::argument, "There is no method " + std::to_string(index), Remedy::call);
  return kMethods[index];
}

}  // namespace dd
