// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>

namespace dd {

/// Memory for a large array that is read from end to end, on large pages where the system has them:
/// looking up small ones takes a third of the time of such a read.
void* allocate_streamed(std::size_t bytes);
void free_streamed(void* memory);

/// A fixed number of values, whatever they are at first.
template <class Value>
class StreamedArray {
 public:
  StreamedArray() = default;
  explicit StreamedArray(std::size_t size)
      : size_(size), values_(static_cast<Value*>(allocate_streamed(size * sizeof(Value)))) {}
  std::size_t size() const { return size_; }
  Value* data() { return values_.get(); }
  const Value* data() const { return values_.get(); }

 private:
  struct Free {
    void operator()(Value* values) const { free_streamed(values); }
  };
  std::size_t size_ = 0;
  std::unique_ptr<Value[], Free> values_;
};

}  // namespace dd
