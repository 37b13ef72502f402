// SPDX-License-Identifier: GPL-3.0-or-later
// Updates of one surface by any method, with any options and matrices, in any order, at once or as
// jobs. Checks the promises about each, and that none depends on those before it.
#include <optional>
#include <string>

#include "surfaces.h"

using namespace dd::fuzz;

namespace {

/// One update: its arguments and its result.
struct Call {
  Motion motion;
  dd_status status = DD_OK;
  std::string sentence;
  Output out;
};

class Updates {
 public:
  Updates(const Bind& bind, Bytes& bytes)
      : bind_(bind), bytes_(bytes), count_(bind.surface.vertex_count()) {}

  dd_status update(dd_deformer* deformer, const Motion& motion, Output& out) const {
    const dd_points_out to = out.get();
    return heeded(motion, dd_deformer_update(deformer, motion.matrices.data(),
                                             motion.matrices.size() / 12, motion.how(), &to));
  }

  /// Makes a call and checks its result. Returns it if it can be repeated.
  std::optional<Call> call(dd_deformer* deformer) {
    Motion motion = any_motion(bind_, bytes_);
    if (motion.endless || bytes_.one_in(5)) {
      as_job(deformer, motion);
      return {};
    }
    Output out(count_, bytes_);
    if (bytes_.odd(32)) {
      const dd_points_out to = counted(out.get(), bytes_);
      out.after(heeded(motion, dd_deformer_update(deformer, bytes_.pointer(motion.matrices.data()),
                                                  bytes_.count(motion.matrices.size() / 12),
                                                  motion.how(), bytes_.pointer(&to))));
      return {};
    }
    Call one{std::move(motion), DD_OK, "", std::move(out)};
    one.status = update(deformer, one.motion, one.out);
    if (one.out.after(one.status)) {
      constraints_met(bind_, one.motion, one.out);
      return one;
    }
    promise(!one.motion.tame, "what is nothing out of the way doesn't fail");
    // With packed points it would not be refused.
    if (one.out.misplaced()) return {};
    one.sentence = dd_last_message();
    return one;
  }

  /// The call once more, with all points packed, must give the same to the bit.
  void repeat(dd_deformer* deformer, const Call& one) const {
    Output again(count_);
    one.motion.base.pack();
    const dd_status status = update(deformer, one.motion, again);
    promise(status == one.status, "what was done before has no say: another status");
    promise(status == DD_OK || one.sentence == dd_last_message(),
            "what was done before has no say: another sentence");
    promise(again.values() == one.out.values(), "what was done before has no say: another result");
  }

 private:
  void as_job(dd_deformer* deformer, const Motion& motion) {
    dd_job* started = nullptr;
    const dd_status status = heeded(
        motion, dd_deformer_update_start(deformer, motion.matrices.data(),
                                         motion.matrices.size() / 12, motion.how(), &started));
    const Owned<dd_job> job(started);
    if (!well(status)) {
      promise(!motion.tame && !job, "outputs are written only on DD_OK: a job was");
      return;
    }
    if (bytes_.one_in(8)) {  // the job may be using the deformer
      const dd_status meanwhile = dd_deformer_update(deformer, nullptr, 0, nullptr, nullptr);
      refused(meanwhile, "an update needs somewhere to go");
    }
    if (bytes_.one_in(16)) return;  // freed while it works
    const dd_status ended = watched(job.get(), bytes_, motion.endless);
    Output out(count_, bytes_);
    const dd_points_out to = out.get();
    const bool there = out.after(dd_job_get_update(job.get(), &to));
    promise(there == (ended == DD_OK && !out.misplaced()), "an update that is done is there");
    const Sized<dd_update_info> info(dd_update_info{}, bytes_);
    info.after(dd_job_get_update_info(job.get(), info.get()));
    if (!there) {
      promise(!motion.tame || ended == DD_ERROR_CANCELLED,
              "what is nothing out of the way doesn't fail");
      return;
    }
    constraints_met(bind_, motion, out);
    Output packed(count_), at_once(count_);
    const dd_points_out once_more = packed.get();
    must(dd_job_get_update(job.get(), &once_more), "an update can be asked for twice");
    const std::vector<float> found = out.values();
    promise(packed.values() == found, "where points lie has no say in an update");
    must(update(deformer, motion, at_once), "what a job does can be done at once");
    // Steps give positions, and offsets are differences of these: not exact to the last digit.
    const double size = extent(bind_.surface.positions);
    const std::vector<float> others = at_once.values();
    for (size_t k = 0; k < found.size(); ++k) {
      const double one = found[k], other = others[k];
      promise(std::abs(one - other) <= 1e-6 * (size + std::abs(one)),
              "a job gives what is given at once");
    }
  }

  static dd_status heeded(const Motion& motion, dd_status status) {
    promise(status != DD_OK || !motion.wrong,
            "an update with a stride or a struct_size that is none is refused");
    return status;
  }

  const Bind& bind_;
  Bytes& bytes_;
  size_t count_;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  Bytes bytes(data, size);
  const Bind bind = any_bind(bytes);
  dd_job* job = nullptr;
  const dd_status status = bind.start(&job, bytes);
  auto deformer =
      taken<dd_deformer>(status, Owned<dd_job>(job), bytes, bind.tame, dd_job_take_deformer);
  if (!deformer) return 0;
  Updates updates(bind, bytes);
  std::vector<Call> calls;
  for (int more = 1 + bytes.below(4); more > 0; --more) {
    if (std::optional<Call> one = updates.call(deformer.get())) calls.push_back(std::move(*one));
    if (bytes.one_in(3)) facts_agree(bind, deformer.get(), bytes);
  }
  if (calls.empty()) return 0;
  updates.repeat(deformer.get(), calls.front());
  if (bytes.flag()) return 0;
  deformer = bind.made(bind.options.threads == 1 ? 3 : 1);
  promise(deformer != nullptr, "what was bound can be bound again");
  updates.repeat(deformer.get(), calls.back());
  return 0;
}
