// SPDX-License-Identifier: GPL-3.0-or-later
// Binds of any mesh with any roles and options, polled and cancelled anywhere; then the facts of
// the deformer, a frame at rest, and refusals of results that a bind doesn't give.
#include "surfaces.h"

using namespace dd::fuzz;

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Bytes bytes(data, size);
  const Bind bind = any_bind(bytes);
  dd_job* started = nullptr;
  const dd_status status = bind.start(&started, bytes);
  Owned<dd_job> job(started);
  if (job && bytes.one_in(16)) return 0;  // freed while it works
  if (job && bytes.one_in(8)) {
    dd_transfer* transfer = nullptr;
    dd_update_info info{};
    info.struct_size = sizeof info;
    refused(dd_job_take_transfer(job.get(), &transfer), "a bind gives no transfer");
    refused(dd_job_get_update_info(job.get(), &info), "a bind is no update");
    promise(!transfer, "outputs are written only on DD_OK: a transfer was");
    const Sized<dd_error> error(dd_error{}, bytes);
    error.after(dd_last_error(error.get()));
  }
  const auto deformer =
      taken<dd_deformer>(status, std::move(job), bytes, bind.tame, dd_job_take_deformer);
  if (!deformer) return 0;
  facts_agree(bind, deformer.get(), bytes);

  // At rest nothing moves, whatever the surface is.
  const auto handles = static_cast<size_t>(bind.surface.handle_count);
  std::vector<double> rest;
  for (size_t h = 0; h < handles; ++h)
    rest.insert(rest.end(), {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0});
  auto options = usual<dd_update_options>();
  options.base = bind.options.base;
  Output out(bind.surface.vertex_count(), bytes);
  const dd_points_out to = out.get();
  if (!out.after(dd_deformer_update(deformer.get(), rest.data(), handles, &options, &to))) {
    promise(!bind.tame, "what is nothing out of the way doesn't fail");
    return 0;
  }
  if (!bind.tame) return 0;
  const double allowed = 1e-4 * extent(bind.surface.positions);
  const std::vector<float> values = out.values();
  for (size_t k = 0; k < values.size(); ++k)
    promise(std::abs(double(values[k]) - double(bind.surface.positions[k])) <= allowed,
            "at rest nothing moves");
  return 0;
}
