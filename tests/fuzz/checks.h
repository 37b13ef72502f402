// SPDX-License-Identifier: GPL-3.0-or-later
// Promises of the public header about every call.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <vector>

#include "bytes.h"
#include "detail_deform/detail_deform.h"

namespace dd::fuzz {

/// Prints the promise that was broken, and aborts.
[[noreturn]] void broken(const char* promise);

inline void promise(bool kept, const char* sentence) {
  if (!kept) broken(sentence);
}

/// Checks that a status is one of dd_status, and that an error has a message and facts that agree
/// with one another. DD_ERROR_MEMORY and DD_ERROR_INTERNAL break a promise. Returns whether it is
/// DD_OK.
bool well(dd_status status);

/// Checks the status of a call that may not be refused.
void must(dd_status status, const char* what);

/// Checks the status of a call that has to be refused.
void refused(dd_status status, const char* what);

/// The error that dd_last_error() gives.
dd_error last_error();

/// The function that fills options with their defaults.
template <class Options>
inline constexpr std::nullptr_t kInit = nullptr;
template <>
inline constexpr auto kInit<dd_bind_options> = dd_bind_options_init;
template <>
inline constexpr auto kInit<dd_refinement_options> = dd_refinement_options_init;
template <>
inline constexpr auto kInit<dd_normal_options> = dd_normal_options_init;
template <>
inline constexpr auto kInit<dd_volumes_options> = dd_volumes_options_init;
template <>
inline constexpr auto kInit<dd_examples_options> = dd_examples_options_init;
template <>
inline constexpr auto kInit<dd_update_options> = dd_update_options_init;
template <>
inline constexpr auto kInit<dd_transfer_options> = dd_transfer_options_init;
template <>
inline constexpr auto kInit<dd_apply_options> = dd_apply_options_init;
template <>
inline constexpr auto kInit<dd_match_options> = dd_match_options_init;
template <>
inline constexpr auto kInit<dd_riders_options> = dd_riders_options_init;
template <>
inline constexpr auto kInit<dd_measure_options> = dd_measure_options_init;

template <class Options>
Options usual() {
  Options options;
  must(kInit<Options>(&options, sizeof options), "defaults can be asked for");
  return options;
}

/// A struct in memory of the size that a caller states, so that sanitizers see accesses beyond it.
/// In a wild input the size may be that of an older or a newer caller.
template <class Struct>
class Sized {
 public:
  Sized(const Struct& values, Bytes& bytes) {
    size_t size = sizeof(Struct);
    // Older headers ended between fields: multiples of 8 bytes don't cut a pointer.
    if (bytes.odd(16)) size = 8 * static_cast<size_t>(bytes.below(int(size / 8) + 3));
    size = std::max(size, sizeof(uint32_t));
    auto said = static_cast<uint32_t>(size);
    wrong_ = bytes.odd(64);
    if (wrong_) said = bytes.flag() ? bytes.below(4) : 4097 + bytes.seed();
    struct_.reset(static_cast<unsigned char*>(std::calloc(1, size)), std::free);
    std::memcpy(struct_.get(), &values, std::min(size, sizeof(Struct)));
    std::memcpy(struct_.get(), &said, sizeof said);
    before_.assign(struct_.get(), struct_.get() + size);
  }

  Struct* get() const { return reinterpret_cast<Struct*>(struct_.get()); }
  /// Whether struct_size is one for which a call has to be refused.
  bool wrong() const { return wrong_; }
  /// The options as the library reads them: defaults beyond the caller's size.
  Struct known() const {
    Struct values = usual<Struct>();
    std::memcpy(&values, before_.data(), std::min(before_.size(), sizeof(Struct)));
    return values;
  }
  /// Checks the struct after a call that returned status: unchanged if it failed. Returns whether
  /// it was filled in.
  bool after(dd_status status) const {
    promise(status != DD_OK || !wrong_, "a struct_size that is none is refused");
    if (well(status)) return true;
    promise(std::equal(before_.begin(), before_.end(), struct_.get()),
            "outputs are written only on DD_OK: a struct was");
    return false;
  }

 private:
  std::shared_ptr<unsigned char> struct_;
  std::vector<unsigned char> before_;
  bool wrong_ = false;
};

/// Watches a job, and cancels it if the bytes say so or if it is endless. Returns the status of
/// dd_job_finish().
dd_status watched(dd_job* job, Bytes& bytes, bool endless = false);

struct Freed {
  void operator()(dd_job* job) const { dd_job_free(job); }
  void operator()(dd_deformer* deformer) const { dd_deformer_free(deformer); }
  void operator()(dd_transfer* transfer) const { dd_transfer_free(transfer); }
  void operator()(dd_match* match) const { dd_match_free(match); }
  void operator()(dd_riders* riders) const { dd_riders_free(riders); }
};
template <class Object>
using Owned = std::unique_ptr<Object, Freed>;

/// The result of a job that was started with this status, after watching it; null if it was
/// refused, cancelled or failed. tame: nothing but a cancel may fail it.
template <class Object>
Owned<Object> taken(dd_status started, Owned<dd_job> job, Bytes& bytes, bool tame,
                    dd_status (*take)(dd_job*, Object**), bool endless = false) {
  if (!well(started)) {
    promise(!tame, "what is nothing out of the way is not refused");
    promise(!job, "outputs are written only on DD_OK: a job was");
    return {};
  }
  promise(job != nullptr, "a job is given on DD_OK");
  Object* object = nullptr;
  const dd_status ended = watched(job.get(), bytes, endless);
  const dd_status status = take(job.get(), &object);
  promise(status == ended, "taking returns the status of the job");
  if (!well(status)) {
    promise(!tame || status == DD_ERROR_CANCELLED, "what is nothing out of the way doesn't fail");
    promise(!object, "outputs are written only on DD_OK: an object was");
    return {};
  }
  Owned<Object> made(object);
  promise(made != nullptr, "an object is given on DD_OK");
  object = nullptr;
  promise(take(job.get(), &object) == DD_ERROR_ARGUMENT && !object, "an object is taken once");
  return made;
}

}  // namespace dd::fuzz
