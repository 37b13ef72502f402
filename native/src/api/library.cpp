// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: what library this is, and what went wrong last.
#include "api/call.h"
#include "kernels/kernels.h"

extern "C" {

int32_t dd_abi_version(void) { return DD_ABI_VERSION; }

const char* dd_version(void) { return DD_VERSION; }

const char* dd_instruction_set(void) { return dd::kernels().name; }

const char* dd_last_message(void) { return dd::api::last_message; }

}  // extern "C"
