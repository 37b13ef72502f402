// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>
#include <new>

namespace dd {

/// A fixed number of values, whatever they are at first: large ones are written anyway, and
/// clearing them before takes as long. Aligned to cache lines, so that no vector of a stream
/// straddles two.
///
/// Huge pages are not asked for. They save some percent of a factor of 100 MB where memory is warm,
/// and cost a fifth of a bind of a gigabyte in a virtual machine that has given its memory back:
/// its host fetches each in small ones.
template <class Value>
class RawArray {
 public:
  RawArray() = default;
  explicit RawArray(std::size_t size)
      : size_(size),
        values_(static_cast<Value*>(::operator new(size * sizeof(Value), kCacheLine))) {}
  std::size_t size() const { return size_; }
  Value* data() { return values_.get(); }
  const Value* data() const { return values_.get(); }

 private:
  static constexpr std::align_val_t kCacheLine{64};
  struct Free {
    void operator()(Value* values) const { ::operator delete(values, kCacheLine); }
  };
  std::size_t size_ = 0;
  std::unique_ptr<Value[], Free> values_;
};

}  // namespace dd
