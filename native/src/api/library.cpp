// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: what library this is, and what went wrong last.
#include "api/arguments.h"
#include "kernels/kernels.h"

using namespace dd::api;

extern "C" {

int32_t dd_abi_version(void) { return DD_ABI_VERSION; }

const char* dd_version(void) { return DD_VERSION; }

const char* dd_instruction_set(void) { return dd::kernels().name; }

dd_status dd_last_error(dd_error* error) {
  return guarded([&] {
    dd_error facts{};
    facts.status = last_problem.status;
    facts.subject = static_cast<dd_subject>(last_problem.subject.kind);
    facts.remedy = static_cast<dd_remedy>(last_problem.remedy);
    facts.index = last_problem.subject.index;
    facts.message = last_problem.message;
    write_struct("error", error, facts);
  });
}

const char* dd_last_message(void) { return last_problem.text; }

}  // extern "C"
