#include "actors/merge/fallback_gather.h"

#include <algorithm>
#include <utility>

namespace moondb {
namespace {

constexpr int kPatienceMax = 64;

}  // namespace

FallbackGather::FallbackGather(std::unique_ptr<GatherBackend> first, Make make_again, int threads)
    : first_(std::move(first)), make_again_(std::move(make_again)), cpu_({threads, nullptr}) {}

std::string FallbackGather::description() const {
  if (first_ != nullptr) return first_->description();
  return cpu_.description() + ", since: " + loss_;
}

Result<void> FallbackGather::Gather(std::span<const OrderedBlock> blocks, std::span<GatherWork> works,
                                    const StopPredicate& stop) {
  if (first_ == nullptr && gathers_left_-- <= 0) {
    if (Result<std::unique_ptr<GatherBackend>> made = make_again_(); made) first_ = std::move(*made);
  }
  if (first_ != nullptr) {
    const Result<void> gathered = first_->Gather(blocks, works, stop);
    if (gathered) {
      patience_ = 1;
      return gathered;
    }
    if (stop && stop()) return gathered;
    loss_ = ToString(gathered.error());
  }
  if (first_ != nullptr || gathers_left_ < 0) {
    first_ = nullptr;
    gathers_left_ = patience_ - 1;
    patience_ = std::min(2 * patience_, kPatienceMax);
  }
  return cpu_.Gather(blocks, works, stop);
}

}  // namespace moondb
