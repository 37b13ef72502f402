// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <memory>

namespace dd {

/// Memory aligned to cache lines, so that no vector of a stream straddles two; a large one of huge
/// pages, if the system has them for those who ask: to fetch a large factor page by page takes some
/// percent of the time to make it. To be freed with free_memory(). Throws std::bad_alloc.
void* get_memory(std::size_t bytes);
void free_memory(void* memory, std::size_t bytes);

/// A fixed number of values, whatever they are at first: large ones are written anyway, and
/// clearing them before takes as long. Aligned to cache lines.
template <class Value>
class RawArray {
 public:
  RawArray() = default;
  explicit RawArray(std::size_t size)
      : size_(size),
        values_(static_cast<Value*>(get_memory(size * sizeof(Value))), Free{size * sizeof(Value)}) {
  }
  std::size_t size() const { return size_; }
  Value* data() { return values_.get(); }
  const Value* data() const { return values_.get(); }

 private:
  struct Free {
    std::size_t bytes = 0;
    void operator()(Value* values) const { free_memory(values, bytes); }
  };
  std::size_t size_ = 0;
  std::unique_ptr<Value[], Free> values_;
};

}  // namespace dd
