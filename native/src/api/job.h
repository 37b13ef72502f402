// SPDX-License-Identifier: GPL-3.0-or-later
// Work of the C ABI that goes on in a thread of the library.
#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "api/call.h"
#include "support/progress.h"

/// Work in a thread of its own that can be watched and cancelled.
struct dd_job {
 public:
  /// name: what it is, with its article.
  explicit dd_job(const char* name) : name_(name) {}
  virtual ~dd_job() { stop(); }
  dd_job(const dd_job&) = delete;
  dd_job& operator=(const dd_job&) = delete;

  const char* name() const { return name_; }
  dd_progress progress() const;
  void cancel() { cancelled_ = true; }
  /// Waits; throws what the work threw.
  void finish();
  /// Waits; all vertices that the sentence of its failure is about.
  const std::vector<int>& vertices();

 protected:
  /// Cancels and waits.
  void stop();

  /// work: called once with a Progress, in the thread.
  template <class Work>
  void start(Work work) {
    try {
      worker_ = std::thread([this, work = std::move(work)]() mutable {
        end(dd::api::guarded([&] {
          Work mine = std::move(work);  // what it holds is let go of before the job is seen to end
          try {
            mine([this](double fraction, dd::Stage stage) { return go_on(fraction, stage); });
          } catch (const dd::Error& error) {
            vertices_ = error.vertices();
            throw;
          }
        }));
      });
    } catch (const std::system_error&) {
      throw dd::Error(dd::Status::memory, "The system has no thread to spare for this work",
                      dd::Remedy::free_resources);
    }
  }

 private:
  void wait();
  bool go_on(double fraction, dd::Stage stage);
  void end(dd_status status);

  const char* name_;
  std::thread worker_;
  std::atomic<double> fraction_{0};
  std::atomic<dd::Stage> stage_{dd::Stage::starting};
  std::atomic<bool> cancelled_{false};
  std::atomic<dd_job_state> state_{DD_JOB_RUNNING};
  // Written by the worker before state_ leaves DD_JOB_RUNNING, read after.
  dd_status status_ = DD_OK;
  dd::api::Problem problem_;
  std::vector<int> vertices_;
};

namespace dd::api {

/// A job that makes an Object.
template <class Object>
class JobFor : public dd_job {
 public:
  using dd_job::dd_job;
  ~JobFor() override { stop(); }  // before what the work writes to is gone

  /// work: gives a std::unique_ptr<Object>.
  template <class Work>
  void run(Work work) {
    start([this, work = std::move(work)](const Progress& progress) mutable {
      result = work(progress);
    });
  }

  std::unique_ptr<Object> result;
};

/// Starts work that gives a std::unique_ptr<Object>, and hands its job to the caller.
template <class Object, class Work>
void start_job(const char* name, dd_job** job, Work work) {
  auto started = std::make_unique<JobFor<Object>>(name);
  started->run(std::move(work));
  *job = started.release();
}

/// The result of a job that has made an Object, when it is there. what: the word for it.
template <class Object>
std::unique_ptr<Object>& result_of(dd_job* job, const char* what) {
  require(job, "job is null");
  auto* found = dynamic_cast<JobFor<Object>*>(job);
  require(found, std::string("This job is ") + job->name() + ", which gives no " + what + "");
  found->finish();
  require(found->result != nullptr, std::string("The ") + what + " of this job was taken already");
  return found->result;
}

/// Gives what a job has made to the caller.
template <class Object>
void take(dd_job* job, const char* what, Object** target) {
  require(target, std::string(what) + " is null");
  *target = result_of<Object>(job, what).release();
}

}  // namespace dd::api
