// SPDX-License-Identifier: GPL-3.0-or-later
#include "api/job.h"

#include <algorithm>

#include "api/arguments.h"

using namespace dd::api;

dd_progress dd_job::progress() const {
  dd_progress now{};
  now.state = state_;
  now.fraction = fraction_;
  now.stage = static_cast<dd_stage>(stage_.load());
  return now;
}

void dd_job::finish() {
  wait();
  if (status_ != DD_OK)
    throw dd::Error(static_cast<dd::Status>(status_), problem_.subject, problem_.message,
                    problem_.remedy);
}

const std::vector<int>& dd_job::vertices() {
  wait();
  return vertices_;
}

void dd_job::stop() {
  cancel();
  wait();
}

void dd_job::wait() {
  if (worker_.joinable()) worker_.join();
}

bool dd_job::go_on(double fraction, dd::Stage stage) {
  fraction_ = std::max<double>(fraction_, fraction);  // parts of the work may report on their own
  stage_ = stage;
  return !cancelled_ || fraction >= 1;
}

void dd_job::end(dd_status status) {
  status_ = status;
  if (status != DD_OK) problem_ = last_problem;
  state_ = status == DD_OK ? DD_JOB_DONE : DD_JOB_FAILED;
}

extern "C" {

dd_status dd_job_poll(const dd_job* job, dd_progress* progress) {
  return guarded([&] {
    require(job, "job is null");
    write_struct("progress", progress, job->progress());
  });
}

dd_status dd_job_cancel(dd_job* job) {
  return guarded([&] {
    require(job, "job is null");
    job->cancel();
  });
}

dd_status dd_job_finish(dd_job* job) {
  return guarded([&] {
    require(job, "job is null");
    job->finish();
  });
}

dd_status dd_job_get_vertices(dd_job* job, int32_t* out, size_t capacity, size_t* vertex_count) {
  return guarded([&] {
    require(job, "job is null");
    write_vertices(job->vertices(), out, capacity, vertex_count);
  });
}

void dd_job_free(dd_job* job) { delete job; }

}  // extern "C"
