// SPDX-License-Identifier: GPL-3.0-or-later
// The C ABI: binds, deformers and their updates.
#include <algorithm>
#include <chrono>
#include <future>
#include <memory>
#include <mutex>

#include "api/job.h"
#include "api/options.h"
#include "deform/draft.h"
#include "support/run_async.h"

using namespace dd::api;

namespace {

/// A deformer, and who uses it: shared by its owner and the jobs that work with it.
struct Bound {
  template <class... Arguments>
  explicit Bound(Arguments&&... arguments) : deformer(std::forward<Arguments>(arguments)...) {}
  dd::Deformer deformer;
  double bind_seconds = 0;
  std::atomic<bool> busy{false};
};

/// The result of an update that runs as a job.
struct Updated {
  FloatRows values;
  dd_update_info info{};
};

}  // namespace

struct dd_deformer {
  std::shared_ptr<Bound> bound;
};

struct dd_draft {
  std::unique_ptr<dd::Draft> draft;
  std::atomic<bool> busy{false};
};

namespace {

Bound& bound_of(const dd_deformer* deformer) {
  require(deformer, "deformer is null");
  return *deformer->bound;
}

InUse use(Bound& bound) { return InUse(bound.busy, "deformer"); }

void require_matrices(const dd::Deformer& deformer, const double* matrices, size_t count) {
  require_count("matrices", matrices, count, count_of(deformer.region().handle_count), "handles");
}

/// Sets count to the number found, and example to the first of them or -1.
void note(const std::vector<int>& found, int32_t& count, int32_t& example) {
  count = static_cast<int32_t>(found.size());
  example = found.empty() ? -1 : found.front();
}

std::vector<int> each_once(std::vector<int> numbers) {
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  return numbers;
}

/// The vertices of these triangles, without repeats.
std::vector<int> corners(const dd::Mesh& mesh, const std::vector<int>& triangles) {
  std::vector<int> found;
  found.reserve(3 * triangles.size());
  for (const int t : triangles)
    for (int k = 0; k < 3; ++k) found.push_back(mesh.triangles(t, k));
  return each_once(std::move(found));
}

std::vector<int> vertices_of(const dd::Deformer& deformer, dd_finding finding) {
  const dd::BaseProxy* proxy = deformer.proxy();
  switch (finding) {
    case DD_FINDING_RESTING:
      return deformer.region().resting;
    case DD_FINDING_LOOSE:
      return deformer.region().isolated;
    case DD_FINDING_DEGENERATE:
      return corners(deformer.mesh(), deformer.degenerate_triangles());
    case DD_FINDING_UNREPRESENTED:
      return each_once(deformer.findings(dd::MethodKind::normal).unrepresented);
    case DD_FINDING_FAR:
      return proxy ? proxy->far : std::vector<int>{};
    case DD_FINDING_TORN:
      return proxy ? proxy->ambiguous : std::vector<int>{};
  }
  return {};
}

/// A bind, which may have a draft while it lasts.
class BindJob final : public JobFor<dd_deformer> {
 public:
  BindJob() : JobFor("a bind") {}
  ~BindJob() override { stop(); }

  void run(dd::Mesh mesh, std::vector<int> roles, int handle_count, dd::BindOptions how,
           bool with_draft) {
    JobFor::run([this, mesh = std::move(mesh), roles = std::move(roles), handle_count,
                 how = std::move(how), with_draft](const dd::Progress& progress) {
      const auto start = std::chrono::steady_clock::now();
      // Made in a thread beside the bind, since much of a bind runs on one thread.
      std::future<void> draft;
      if (with_draft) {
        draft = dd::run_async(how.threads, [&] { make_draft(mesh, roles, handle_count, how); });
        if (draft.wait_for(std::chrono::seconds(0)) == std::future_status::deferred) draft.get();
      }
      auto bound = std::make_shared<Bound>(mesh, roles, handle_count, how, progress);
      bound->bind_seconds =
          std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
      return std::make_unique<dd_deformer>(dd_deformer{std::move(bound)});
    });
  }

  std::unique_ptr<dd_draft> take_draft() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::move(draft_);
  }

 private:
  void make_draft(const dd::Mesh& mesh, const std::vector<int>& roles, int handle_count,
                  const dd::BindOptions& how) {
    std::unique_ptr<dd::Draft> made;
    try {
      made = dd::Draft::make(mesh, roles, handle_count, how);
    } catch (const std::exception&) {
      // Ignored: the bind reports the same fault.
    }
    if (!made) return;
    auto draft = std::make_unique<dd_draft>();
    draft->draft = std::move(made);
    const std::lock_guard<std::mutex> lock(mutex_);
    draft_ = std::move(draft);
  }

  std::mutex mutex_;
  std::unique_ptr<dd_draft> draft_;
};

/// The update, as steps where there are any; on_deformer_released: see split_update().
dd::SplitResult update_in_steps(dd::Deformer& deformer, const Update& update,
                                Strided<FloatRows> out, const dd::Progress& progress = {},
                                const std::function<void()>& on_deformer_released = {}) {
  dd::SplitResult result = dd::split_update(deformer, update.motion, update.options, progress,
                                            update.base(), on_deformer_released);
  if (update.values == Values::positions) result.offsets += deformer.mesh().positions;
  write_floats(result.offsets, out);
  return result;
}

}  // namespace

extern "C" {

dd_status dd_deformer_bind_start(const dd_mesh* mesh, const int32_t* roles, size_t role_count,
                                 int32_t handle_count, const dd_bind_options* options,
                                 dd_job** job) {
  return guarded([&] {
    require(job, "job is null");
    dd::Mesh surface = read_mesh("mesh", mesh);
    const size_t vertices = mesh->vertices.count;
    std::vector<int> of_vertices = read_roles(roles, role_count, vertices);
    Bind bind = read_bind_options(options, vertices);
    auto started = std::make_unique<BindJob>();
    started->run(std::move(surface), std::move(of_vertices), handle_count, std::move(bind.options),
                 bind.with_draft);
    *job = started.release();
  });
}

dd_status dd_job_take_draft(dd_job* job, dd_draft** draft) {
  return guarded([&] {
    require(job, "job is null");
    require(draft, "draft is null");
    auto* bind = dynamic_cast<BindJob*>(job);
    require(bind, std::string("This job is ") + job->name() + ", which has no draft");
    *draft = bind->take_draft().release();
  });
}

dd_status dd_draft_update(dd_draft* draft, const double* matrices, size_t matrix_count,
                          const dd_update_options* options, const dd_points_out* out) {
  return guarded([&] {
    require(draft, "draft is null");
    const InUse in_use(draft->busy, "draft");
    dd::Draft& surface = *draft->draft;
    require_matrices(surface.coarse(), matrices, matrix_count);
    Strided<FloatRows> result =
        result_points("out", out, count_of(static_cast<int>(surface.rest().rows())));
    const Update update = read_update_options(options, surface.coarse());
    const dd::Positions& offsets = surface.update(matrices, update.options);
    if (update.values == Values::positions)
      write_floats(surface.rest() + offsets, result);
    else
      write_floats(offsets, result);
  });
}

void dd_draft_free(dd_draft* draft) { delete draft; }

dd_status dd_job_take_deformer(dd_job* job, dd_deformer** deformer) {
  return guarded([&] { take(job, "deformer", deformer); });
}

dd_status dd_deformer_update(dd_deformer* deformer, const double* matrices, size_t matrix_count,
                             const dd_update_options* options, const dd_points_out* out) {
  return guarded([&] {
    Bound& bound = bound_of(deformer);
    const InUse in_use = use(bound);
    dd::Deformer& surface = bound.deformer;
    require_matrices(surface, matrices, matrix_count);
    Strided<FloatRows> result = result_points("out", out, count_of(surface.mesh().vertex_count()));
    Update update = read_update_options(options, surface);
    if (update.motion.steps == 1) {
      surface.update_to(result.data(), result.outerStride(), update.values == Values::positions,
                        matrices, update.options, update.base());
      return;
    }
    update.motion.matrices.assign(matrices, matrices + 12 * matrix_count);
    update_in_steps(surface, update, result);
  });
}

dd_status dd_deformer_update_start(dd_deformer* deformer, const double* matrices,
                                   size_t matrix_count, const dd_update_options* options,
                                   dd_job** job) {
  return guarded([&] {
    require(job, "job is null");
    Bound& bound = bound_of(deformer);
    InUse in_use = use(bound);
    require_matrices(bound.deformer, matrices, matrix_count);
    Update update = read_update_options(options, bound.deformer);
    update.motion.matrices.assign(matrices, matrices + 12 * matrix_count);
    start_job<Updated>("an update", job,
                       [bound = deformer->bound, in_use = std::move(in_use),
                        update = std::move(update)](const dd::Progress& progress) mutable {
                         InUse first_step = std::move(in_use);
                         auto made = std::make_unique<Updated>();
                         made->values.resize(bound->deformer.mesh().vertex_count(), 3);
                         const Strided<FloatRows> values(made->values.data(), made->values.rows(),
                                                         3, Eigen::OuterStride<>(3));
                         const dd::SplitResult result =
                             update_in_steps(bound->deformer, update, values, progress,
                                             [&] { first_step.release(); });
                         made->info.volumes_converged = result.volumes_converged;
                         made->info.volume_error = result.volume_error;
                         return made;
                       });
  });
}

dd_status dd_job_get_update(dd_job* job, const dd_points_out* out) {
  return guarded([&] {
    const FloatRows& values = result_of<Updated>(job, "update")->values;
    result_points("out", out, static_cast<size_t>(values.rows())) = values;
  });
}

dd_status dd_job_get_update_info(dd_job* job, dd_update_info* info) {
  return guarded([&] { write_struct("info", info, result_of<Updated>(job, "update")->info); });
}

dd_status dd_deformer_get_info(const dd_deformer* deformer, dd_deformer_info* info) {
  return guarded([&] {
    Bound& of = bound_of(deformer);
    const InUse in_use = use(of);
    const dd::Deformer& bound = of.deformer;
    const dd::Region& region = bound.region();
    dd_deformer_info facts{};
    facts.vertex_count = bound.mesh().vertex_count();
    facts.triangle_count = bound.mesh().triangle_count();
    facts.handle_count = region.handle_count;
    facts.free_count = region.free_count();
    note(region.resting, facts.resting_count, facts.resting_example);
    facts.resting_component_count = region.resting_component_count;
    note(region.isolated, facts.loose_count, facts.loose_example);
    note(region.idle_handles, facts.idle_handle_count, facts.idle_handle_example);
    note(bound.degenerate_triangles(), facts.degenerate_count, facts.degenerate_example);
    const dd::MethodFindings detail = bound.findings(dd::MethodKind::detail);
    facts.stand_in_count = detail.stand_in_count;
    facts.coarse_vertex_count = detail.coarse_vertex_count;
    const dd::MethodFindings normal = bound.findings(dd::MethodKind::normal);
    note(normal.unrepresented, facts.unrepresented_count, facts.unrepresented_example);
    facts.far_example = facts.torn_example = -1;
    if (const dd::BaseProxy* proxy = bound.proxy()) {
      facts.proxy_vertex_count = proxy->vertex_count();
      note(proxy->far, facts.far_count, facts.far_example);
      note(proxy->ambiguous, facts.torn_count, facts.torn_example);
    }
    facts.bind_seconds = of.bind_seconds;
    facts.bytes = bound.bytes();
    write_struct("info", info, facts);
  });
}

dd_status dd_deformer_get_vertices(const dd_deformer* deformer, dd_finding finding, int32_t* out,
                                   size_t capacity, size_t* vertex_count) {
  return guarded([&] {
    Bound& bound = bound_of(deformer);
    const InUse in_use = use(bound);
    write_vertices(vertices_of(bound.deformer, choice("finding", finding, DD_FINDING_TORN)), out,
                   capacity, vertex_count);
  });
}

dd_status dd_deformer_get_example_weights(const dd_deformer* deformer, double* out,
                                          size_t out_count) {
  return guarded([&] {
    Bound& bound = bound_of(deformer);
    const InUse in_use = use(bound);
    const std::vector<double> weights =
        bound.deformer.findings(dd::MethodKind::examples).example_weights;
    require_count("out", out, out_count, weights.size(), "examples");
    std::copy(weights.begin(), weights.end(), out);
  });
}

void dd_deformer_free(dd_deformer* deformer) { delete deformer; }

}  // extern "C"
