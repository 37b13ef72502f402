// SPDX-License-Identifier: GPL-3.0-or-later
// Updates of one surface by any method, with any options and matrices, in any order, at once or as
// jobs: what is promised of each, and that none knows of the others.
#include <optional>
#include <string>

#include "surfaces.h"

using namespace dd::fuzz;

namespace {

/// One update: what was asked for and what came of it.
struct Call {
  Motion motion;
  int32_t status = DD_OK;
  std::string sentence;
  Output<float> out;
};

class Updates {
 public:
  Updates(const Bind& bind, Bytes& bytes)
      : bind_(bind), bytes_(bytes), count_(bind.surface.vertex_count()) {}

  int32_t update(dd_deformer* deformer, const Motion& motion, float* out) const {
    return dd_deformer_update(deformer, motion.matrices.data(), motion.matrices.size() / 12,
                              motion.how(), out, count_);
  }

  /// What a call gives is looked at; that of one that can be repeated is returned.
  std::optional<Call> call(dd_deformer* deformer) {
    Motion motion = any_motion(bind_, bytes_);
    if (motion.endless || bytes_.one_in(5)) {
      as_job(deformer, motion);
      return {};
    }
    if (bytes_.odd(32)) {
      Output<float> out(count_);
      out.after(dd_deformer_update(deformer, bytes_.pointer(motion.matrices.data()),
                                   bytes_.count(motion.matrices.size() / 12), motion.how(),
                                   bytes_.pointer(out.data()), bytes_.count(count_)));
      return {};
    }
    Call one{std::move(motion), DD_OK, "", Output<float>(count_)};
    one.status = update(deformer, one.motion, one.out.data());
    if (one.out.after(one.status)) {
      constraints_met(bind_, one.motion, one.out);
      return one;
    }
    promise(!one.motion.tame, "what is nothing out of the way doesn't fail");
    one.sentence = dd_last_message();
    return one;
  }

  /// Done once more it gives the same, to the bit.
  void repeat(dd_deformer* deformer, const Call& one) const {
    Output<float> again(count_);
    const int32_t status = update(deformer, one.motion, again.data());
    promise(status == one.status, "what was done before has no say: another status");
    promise(status == DD_OK || one.sentence == dd_last_message(),
            "what was done before has no say: another sentence");
    promise(again.values() == one.out.values(), "what was done before has no say: another result");
  }

 private:
  void as_job(dd_deformer* deformer, const Motion& motion) {
    dd_job* started = nullptr;
    const int32_t status = dd_update_start(deformer, motion.matrices.data(),
                                           motion.matrices.size() / 12, motion.how(), &started);
    const Owned<dd_job> job(started);
    if (!well(status)) {
      promise(!motion.tame && !job, "outputs are written only on DD_OK: a job was");
      return;
    }
    if (bytes_.one_in(8)) {  // it may be in use
      const int32_t meanwhile = dd_deformer_update(deformer, nullptr, 0, nullptr, nullptr, 0);
      refused(meanwhile, "an update needs somewhere to go");
    }
    if (bytes_.one_in(16)) return;  // let go of while it works
    const int32_t ended = watched(job.get(), bytes_, motion.endless);
    Output<float> out(count_);
    const bool there = out.after(dd_job_get_update(job.get(), out.data(), count_));
    promise(there == (ended == DD_OK), "an update that is done is there");
    Sized<dd_update_info> info(dd_update_info{}, bytes_);
    info.after(dd_job_get_update_info(job.get(), info.get()));
    if (!there) {
      promise(!motion.tame || ended == DD_ERROR_CANCELLED,
              "what is nothing out of the way doesn't fail");
      return;
    }
    constraints_met(bind_, motion, out);
    Output<float> at_once(count_);
    must(update(deformer, motion, at_once.data()), "what a job does can be done at once");
    // Steps add up to positions, from which offsets are taken: not to the last digit.
    const double size = extent(bind_.surface.positions);
    for (size_t k = 0; k < out.values().size(); ++k) {
      const double one = out.values()[k], other = at_once.values()[k];
      promise(std::abs(one - other) <= 1e-6 * (size + std::abs(one)),
              "a job gives what is given at once");
    }
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
  const int32_t status = bind.start(&job, bytes);
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
