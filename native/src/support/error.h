// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace dd {

/// The values are those of dd_status in the public header.
enum class Status { ok = 0, argument, mesh, region, numeric, memory, cancelled, busy, internal };

/// Everything the core refuses: a kind for programs and a sentence for people.
class Error : public std::runtime_error {
 public:
  /// vertices: all that the sentence is about, where it names one of them.
  Error(Status status, const std::string& sentence, std::vector<int> vertices = {})
      : std::runtime_error(sentence),
        status_(status),
        vertices_(std::make_shared<const std::vector<int>>(std::move(vertices))) {}
  Status status() const { return status_; }
  const std::vector<int>& vertices() const { return *vertices_; }

 private:
  Status status_;
  std::shared_ptr<const std::vector<int>> vertices_;  // shared: copying an exception must not fail
};

/// The refusal of a result that floats can't hold.
inline Error leaves_single_precision() {
  return {Status::numeric,
          "The handles' matrices are too large: the deformed surface leaves the range of single "
          "precision."};
}

}  // namespace dd
