// SPDX-License-Identifier: GPL-3.0-or-later
// Allocations and thread starts that fail when a test says so.
#pragma once

namespace dd::test {

/// Makes the first to the last of the allocations, or of the thread starts, fail. They are counted
/// from the construction of this object on; after its destruction none fails.
class Failing {
 public:
  enum What { allocations, threads };
  static constexpr long kNever = -1;

  Failing(What what, long first, long last);
  Failing(What what, long one) : Failing(what, one, one) {}
  ~Failing();
  Failing(const Failing&) = delete;
  Failing& operator=(const Failing&) = delete;

  /// How many were asked for since, and whether one failed.
  static long asked();
  static bool failed();
};

/// Allocations by the core that have not been freed.
long living_allocations();

}  // namespace dd::test
