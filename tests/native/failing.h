// SPDX-License-Identifier: GPL-3.0-or-later
// Memory and threads that run out when a test says so.
#pragma once

namespace dd::test {

/// Which of the allocations, or of the threads started, fail: all from first to last, counted from
/// the making of this object, and none any more when it goes.
class Failing {
 public:
  enum What { allocations, threads };
  static constexpr long kNever = -1;

  Failing(What what, long first, long last);
  Failing(What what, long one) : Failing(what, one, one) {}
  ~Failing();
  Failing(const Failing&) = delete;
  Failing& operator=(const Failing&) = delete;

  /// How many have been asked for, and whether one has failed.
  static long asked();
  static bool failed();
};

/// Allocations by the core that have not been freed.
long living_allocations();

}  // namespace dd::test
