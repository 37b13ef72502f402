// SPDX-License-Identifier: GPL-3.0-or-later
#include "streamed_array.h"

#include <cstdlib>
#include <new>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace dd {

#ifdef __linux__

void* allocate_streamed(std::size_t bytes) {
  constexpr std::size_t kPage = std::size_t{1} << 21;
  if (bytes < kPage) {
    void* memory = std::malloc(bytes ? bytes : 1);
    if (!memory) throw std::bad_alloc();
    return memory;
  }
  void* memory = nullptr;
  if (posix_memalign(&memory, kPage, bytes) != 0) throw std::bad_alloc();
  // A refusal costs speed only.
  madvise(memory, bytes, MADV_HUGEPAGE);
  return memory;
}

void free_streamed(void* memory) { std::free(memory); }

#else

void* allocate_streamed(std::size_t bytes) { return ::operator new(bytes); }
void free_streamed(void* memory) { ::operator delete(memory); }

#endif

}  // namespace dd
