// SPDX-License-Identifier: GPL-3.0-or-later
#include "support/raw_array.h"

#include <new>
#ifdef __linux__
#include <sys/mman.h>
#endif

namespace dd {

namespace {

constexpr std::size_t kCacheLine = 64, kHugePage = std::size_t{2} << 20;

std::align_val_t alignment(std::size_t bytes) {
  return std::align_val_t{bytes < 2 * kHugePage ? kCacheLine : kHugePage};
}

}  // namespace

void* get_memory(std::size_t bytes) {
  void* memory = ::operator new(bytes, alignment(bytes));
#ifdef __linux__
  // No more than a wish: what it answers doesn't matter.
  if (bytes >= 2 * kHugePage) madvise(memory, bytes, MADV_HUGEPAGE);
#endif
  return memory;
}

void free_memory(void* memory, std::size_t bytes) { ::operator delete(memory, alignment(bytes)); }

}  // namespace dd
