// SPDX-License-Identifier: GPL-3.0-or-later
// Points as callers hold them: packed, or with other data in between.
#pragma once

#include <memory>
#include <utility>

#include "checks.h"
#include "flat_mesh.h"

namespace dd::fuzz {

constexpr size_t kPacked = 3 * sizeof(float);

/// Whether points have a stride for which a call has to be refused.
template <class Given>
bool misplaced(const Given& points) {
  return points.count > 0 &&
         (points.stride < kPacked || points.stride > 4096 || points.stride % sizeof(float) != 0);
}

/// The points; in a wild input now and then with a wrong count, or null.
template <class Given>
Given counted(Given points, Bytes& bytes) {
  points.first = bytes.pointer(points.first);
  points.count = bytes.count(points.count);
  return points;
}

/// Floats from one point to the next; 3 at a stride for which nothing is read or written.
inline size_t step(size_t stride) {
  return misplaced(dd_points{nullptr, 1, stride}) ? 3 : stride / sizeof(float);
}
inline size_t room(size_t count, size_t stride) {
  return count == 0 ? 0 : (count - 1) * step(stride) + 3;
}

/// Points to read, in memory that ends with the last one. Floats between them are NaN.
class Points {
 public:
  Points() = default;
  Points(std::vector<float> values, Bytes& bytes) : packed_(std::move(values)) {
    packed_.shrink_to_fit();
    const size_t count = packed_.size() / 3, stride = bytes.stride(), apart = step(stride);
    if (apart > 3) {
      spread_.assign(room(count, stride), std::numeric_limits<float>::quiet_NaN());
      for (size_t v = 0; v < count; ++v)
        std::copy_n(&packed_[3 * v], 3, spread_.data() + v * apart);
    }
    given_ = std::make_unique<dd_points>(dd_points{data(), count, stride});
  }

  const std::vector<float>& values() const { return packed_; }
  dd_points packed() const { return detail_deform::points(packed_); }
  /// The points with the bytes' stride, at an address that stays, or null without points.
  dd_points* given() const { return given_.get(); }
  bool misplaced() const { return given_ && fuzz::misplaced(*given_); }
  bool spread() const { return !spread_.empty(); }
  /// Makes given() packed from now on, unless it is invalid.
  void pack() const {
    if (!given_ || misplaced() || given_->first != data()) return;
    given_->first = packed_.data();
    given_->stride = kPacked;
  }

 private:
  const float* data() const { return spread() ? spread_.data() : packed_.data(); }

  std::vector<float> packed_, spread_;
  std::unique_ptr<dd_points> given_;
};

/// A mesh whose vertices have the bytes' stride.
class GivenMesh {
 public:
  GivenMesh(const test::FlatMesh& mesh, Bytes& bytes)
      : vertices_(mesh.positions, bytes), mesh_(mesh.mesh()) {
    mesh_.vertices = *vertices_.given();
  }

  const dd_mesh* get() const { return &mesh_; }
  bool misplaced() const { return vertices_.misplaced(); }
  bool spread() const { return vertices_.spread(); }

 private:
  Points vertices_;
  dd_mesh mesh_;
};

/// Points to write, in memory that ends with the last one.
class Output {
 public:
  explicit Output(size_t count, size_t stride = kPacked)
      : count_(count), stride_(stride), values_(room(count, stride), kUntouched) {}
  Output(size_t count, Bytes& bytes) : Output(count, bytes.stride()) {}

  dd_points_out get() { return {values_.data(), count_, stride_}; }
  bool misplaced() const { return fuzz::misplaced(dd_points_out{nullptr, count_, stride_}); }
  const float* at(size_t row) const { return values_.data() + row * step(stride_); }
  /// The points, packed.
  std::vector<float> values() const {
    std::vector<float> packed;
    packed.reserve(3 * count_);
    for (size_t v = 0; v < count_; ++v) packed.insert(packed.end(), at(v), at(v) + 3);
    return packed;
  }

  /// Checks the points after a call that returned status: untouched if it failed, else finite, with
  /// nothing written in between. Returns whether they are a result.
  bool after(dd_status status) const {
    promise(status != DD_OK || !misplaced(), "a stride that no points can have is refused");
    const bool there = well(status);
    for (size_t k = 0; k < values_.size(); ++k) {
      if (!there)
        promise(values_[k] == kUntouched, "outputs are written only on DD_OK: an array was");
      else if (k % step(stride_) < 3)
        promise(std::isfinite(values_[k]), "a result is finite");
      else
        promise(values_[k] == kUntouched, "what lies between points is left alone");
    }
    return there;
  }

 private:
  static constexpr float kUntouched = -77.25F;
  size_t count_, stride_;
  std::vector<float> values_;
};

}  // namespace dd::fuzz
