// SPDX-License-Identifier: GPL-3.0-or-later
// The linker's --wrap sends the core's and its Eigen's calls of malloc here; operator new and
// pthread_create are replaced for the whole program.
#include "failing.h"

#include <dlfcn.h>
#include <pthread.h>

#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <new>

namespace dd::test {

namespace {

std::atomic<int> failing{-1};  // a Failing::What, or -1 while nothing is to fail
std::atomic<long> count{0}, first_to_fail{Failing::kNever}, last_to_fail{Failing::kNever};
std::atomic<bool> any_failed{false};
std::atomic<long> living{0};

bool fails(Failing::What what) {
  if (failing != what) return false;
  const long number = count++;
  if (number < first_to_fail || number > last_to_fail) return false;
  any_failed = true;
  return true;
}

}  // namespace

Failing::Failing(What what, long first, long last) {
  count = 0;
  first_to_fail = first;
  last_to_fail = last;
  any_failed = false;
  failing = what;
}

Failing::~Failing() { failing = -1; }

long Failing::asked() { return count; }
bool Failing::failed() { return any_failed; }

long living_allocations() { return living; }

/// Counts the allocation that make() does, or returns null if it is one that is to fail.
template <class Make>
void* counted(const Make& make) {
  void* made = fails(Failing::allocations) ? nullptr : make();
  living += made != nullptr;
  return made;
}

void freed(void* memory) { living -= memory != nullptr; }

}  // namespace dd::test

using dd::test::counted;
using dd::test::Failing;
using dd::test::freed;

extern "C" {

void* __real_malloc(std::size_t size);
void* __real_calloc(std::size_t count, std::size_t size);
void* __real_realloc(void* memory, std::size_t size);
void __real_free(void* memory);

void* __wrap_malloc(std::size_t size) {
  return counted([=] { return __real_malloc(size); });
}

void* __wrap_calloc(std::size_t count, std::size_t size) {
  return counted([=] { return __real_calloc(count, size); });
}

void* __wrap_realloc(void* memory, std::size_t size) {
  if (!memory) return __wrap_malloc(size);
  return dd::test::fails(Failing::allocations) ? nullptr : __real_realloc(memory, size);
}

void __wrap_free(void* memory) {
  freed(memory);
  __real_free(memory);
}

int pthread_create(pthread_t* thread, const pthread_attr_t* attributes, void* (*start)(void*),
                   void* argument) {
  static const auto next =
      reinterpret_cast<decltype(&pthread_create)>(dlsym(RTLD_NEXT, "pthread_create"));
  return dd::test::fails(Failing::threads) ? EAGAIN : next(thread, attributes, start, argument);
}

}  // extern "C"

namespace {

void* plain(std::size_t size) noexcept {
  return counted([=] { return __real_malloc(size ? size : 1); });
}

void* aligned(std::size_t size, std::align_val_t alignment) noexcept {
  const std::size_t unit = static_cast<std::size_t>(alignment);
  return counted([=] { return std::aligned_alloc(unit, (size + unit - 1) / unit * unit); });
}

void* or_throw(void* memory) { return memory ? memory : throw std::bad_alloc(); }

}  // namespace

void* operator new(std::size_t size) { return or_throw(plain(size)); }
void* operator new[](std::size_t size) { return or_throw(plain(size)); }
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return plain(size); }
void* operator new[](std::size_t size, const std::nothrow_t&) noexcept { return plain(size); }
void* operator new(std::size_t size, std::align_val_t unit) {
  return or_throw(aligned(size, unit));
}

void operator delete(void* memory) noexcept { __wrap_free(memory); }
void operator delete[](void* memory) noexcept { __wrap_free(memory); }
void operator delete(void* memory, std::size_t) noexcept { __wrap_free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { __wrap_free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { __wrap_free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { __wrap_free(memory); }
