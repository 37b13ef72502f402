// SPDX-License-Identifier: GPL-3.0-or-later
#include "checks.h"

#include <cstdio>
#include <cstdlib>
#include <string>

namespace dd::fuzz {

void broken(const char* promise) {
  std::fprintf(stderr, "BROKEN PROMISE: %s\nlast message: %s\n", promise, dd_last_message());
  std::abort();
}

namespace {

bool is_utf8(const char* text) {
  const auto* at = reinterpret_cast<const unsigned char*>(text);
  while (*at) {
    const int more = *at < 0x80 ? 0 : *at >= 0xc2 && *at < 0xe0 ? 1 : *at < 0xf0 ? 2 : 3;
    if (*at >= 0xf5 || (*at >= 0x80 && *at < 0xc2)) return false;
    ++at;
    for (int k = 0; k < more; ++k, ++at)
      if ((*at & 0xc0) != 0x80) return false;
  }
  return true;
}

}  // namespace

bool well(dd_status status) {
  if (status == DD_OK) return true;
  promise(status > DD_OK && status < DD_ERROR_INTERNAL, "a status is one of dd_status");
  promise(status != DD_ERROR_MEMORY, "small inputs take little memory");
  const std::string sentence = dd_last_message();
  promise(sentence.size() >= 12 && sentence.back() == '.', "an error has a sentence");
  promise(is_utf8(sentence.c_str()), "a sentence is UTF-8");
  const dd_error error = last_error();
  promise(error.status == status, "an error is that of the last call that failed");
  promise(error.subject >= DD_SUBJECT_NONE && error.subject <= DD_SUBJECT_BASE_TRIANGLE,
          "the subject of an error is known");
  promise(error.remedy >= DD_REMEDY_NONE && error.remedy <= DD_REMEDY_SAME_VERTICES,
          "the remedy of an error is known");
  promise(error.subject == DD_SUBJECT_NONE ? error.index == -1 : error.index >= 0,
          "an error has an index exactly where it has a subject");
  promise(error.message && std::strlen(error.message) >= 8 &&
              sentence.find(error.message) != std::string::npos,
          "the message of an error is part of its sentence");
  promise(sentence == dd_last_message(), "who asks for an error leaves it as it is");
  return false;
}

dd_error last_error() {
  dd_error error{};
  error.struct_size = sizeof error;
  promise(dd_last_error(&error) == DD_OK, "an error can be asked for");
  return error;
}

void must(dd_status status, const char* what) {
  if (!well(status)) broken(what);
}

void refused(dd_status status, const char* what) {
  if (well(status)) broken(what);
}

dd_status watched(dd_job* job, Bytes& bytes, bool endless) {
  // A job is cancelled after some polls, or never. An endless one only ends by that.
  const bool cancels = endless || bytes.one_in(8);
  const int polls = cancels ? bytes.below(64) : 0;
  double before = 0;
  for (int k = 0; k < polls; ++k) {
    dd_progress progress{};
    progress.struct_size = sizeof progress;
    must(dd_job_poll(job, &progress), "a job can be polled");
    promise(progress.fraction >= before && progress.fraction <= 1, "progress rises from 0 to 1");
    promise(progress.stage >= DD_STAGE_STARTING && progress.stage <= DD_STAGE_DONE,
            "a stage is known");
    promise(progress.state >= DD_JOB_RUNNING && progress.state <= DD_JOB_FAILED,
            "a state is known");
    before = progress.fraction;
  }
  if (cancels) must(dd_job_cancel(job), "a job can be cancelled");
  const dd_status status = dd_job_finish(job);
  well(status);
  promise(status != DD_ERROR_CANCELLED || cancels, "only what is cancelled ends so");
  const std::string sentence = status == DD_OK ? "" : dd_last_message();
  promise(dd_job_finish(job) == status, "a job can be finished twice");
  promise(status == DD_OK || sentence == dd_last_message(), "a job keeps its sentence");
  dd_progress progress{};
  progress.struct_size = sizeof progress;
  must(dd_job_poll(job, &progress), "a job that has ended can be polled");
  promise(progress.state == (status == DD_OK ? DD_JOB_DONE : DD_JOB_FAILED),
          "a job's state is its end");
  promise(progress.stage >= DD_STAGE_STARTING && progress.stage <= DD_STAGE_DONE,
          "a stage is known");
  promise(status != DD_OK || progress.fraction == 1, "a job that is done is done to the end");
  return status;
}

}  // namespace dd::fuzz
