// SPDX-License-Identifier: GPL-3.0-or-later
// Lets a library linked on a new glibc load on an old one (Blender itself asks for 2.28).
//
// The static libstdc++ and libgcc inside the library refer to functions whose newest versions
// are younger. Most were only moved from libpthread into libc, so their first versions do; the
// linker's --wrap sends every reference here. _dl_find_object is a faster dl_iterate_phdr, which
// exceptions are looked up with. pow and log got new versions that don't report errors, and strtoul
// got another name (__isoc23_strtoul, 2.38), by which it also reads binary numbers.
#include <dlfcn.h>
#include <elf.h>
#include <link.h>
#include <pthread.h>

extern "C" {

#if defined(__aarch64__)
#define DD_FIRST_GLIBC "@GLIBC_2.17"
#else
#define DD_FIRST_GLIBC "@GLIBC_2.2.5"
#endif
#define DD_FIRST_VERSION(name) __asm__(".symver first_" #name "," #name DD_FIRST_GLIBC)
DD_FIRST_VERSION(pthread_create);
DD_FIRST_VERSION(pthread_join);
DD_FIRST_VERSION(pthread_once);
DD_FIRST_VERSION(__pthread_key_create);
DD_FIRST_VERSION(pow);
DD_FIRST_VERSION(log);
DD_FIRST_VERSION(strtoul);
#undef DD_FIRST_VERSION
#undef DD_FIRST_GLIBC

int first_pthread_create(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
int first_pthread_join(pthread_t, void**);
int first_pthread_once(pthread_once_t*, void (*)());
int first___pthread_key_create(pthread_key_t*, void (*)(void*));
double first_pow(double, double);
double first_log(double);
unsigned long first_strtoul(const char*, char**, int);

int __wrap_pthread_create(pthread_t* thread, const pthread_attr_t* attributes,
                          void* (*start)(void*), void* argument) {
  return first_pthread_create(thread, attributes, start, argument);
}
int __wrap_pthread_join(pthread_t thread, void** result) {
  return first_pthread_join(thread, result);
}
int __wrap_pthread_once(pthread_once_t* once, void (*routine)()) {
  return first_pthread_once(once, routine);
}
int __wrap___pthread_key_create(pthread_key_t* key, void (*destroy)(void*)) {
  return first___pthread_key_create(key, destroy);
}
double __wrap_pow(double base, double exponent) { return first_pow(base, exponent); }
double __wrap_log(double value) { return first_log(value); }
unsigned long __wrap___isoc23_strtoul(const char* text, char** end, int base) {
  return first_strtoul(text, end, base);
}

// libstdc++ skips atomic operations while this is not zero.
char __libc_single_threaded = 0;
}

namespace {

/// The layout of glibc's struct dl_find_object (2.35) on both processors.
struct FoundObject {
  unsigned long long flags;
  void* map_start;
  void* map_end;
  struct link_map* link_map;
  void* eh_frame;
};

struct Search {
  ElfW(Addr) address;
  FoundObject* found;
};

int look_into(dl_phdr_info* object, size_t, void* data) {
  const Search& search = *static_cast<Search*>(data);
  const ElfW(Phdr)* covering = nullptr;
  const ElfW(Phdr)* eh_frame = nullptr;
  for (int i = 0; i < object->dlpi_phnum; ++i) {
    const ElfW(Phdr) & part = object->dlpi_phdr[i];
    const ElfW(Addr) start = object->dlpi_addr + part.p_vaddr;
    if (part.p_type == PT_LOAD && search.address >= start && search.address < start + part.p_memsz)
      covering = &part;
    if (part.p_type == PT_GNU_EH_FRAME) eh_frame = &part;
  }
  if (!covering) return 0;
  if (!eh_frame) return -1;
  char* base = reinterpret_cast<char*>(object->dlpi_addr);
  *search.found = {0, base + covering->p_vaddr, base + covering->p_vaddr + covering->p_memsz,
                   nullptr, base + eh_frame->p_vaddr};
  return 1;
}

}  // namespace

extern "C" int __wrap__dl_find_object(void* address, FoundObject* result) {
  Search search = {reinterpret_cast<ElfW(Addr)>(address), result};
  return dl_iterate_phdr(look_into, &search) == 1 ? 0 : -1;
}
