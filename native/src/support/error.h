// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <stdexcept>
#include <string>

namespace dd {

/// The values are those of dd_status in the public header.
enum class Status { ok = 0, argument, mesh, region, numeric, memory, cancelled, busy, internal };

/// Everything the core refuses: a kind for programs and a sentence for people.
class Error : public std::runtime_error {
 public:
  Error(Status status, const std::string& sentence)
      : std::runtime_error(sentence), status_(status) {}
  Status status() const { return status_; }

 private:
  Status status_;
};

/// The refusal of a result that floats can't hold.
inline Error leaves_single_precision() {
  return {Status::numeric,
          "The handles' matrices are too large: the deformed surface leaves the range of single "
          "precision."};
}

}  // namespace dd
