// FallbackGather: a backend that may be lost, with the CPU behind it.
//
// When the first fails, the CPU does the same tiles at once, and what failed is dropped. It is made anew for a later
// gather: the next one, then after 2, 4, ... up to 64, so that a driver that is gone costs little, and one that comes
// back is used again.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "actors/merge/cpu_gather.h"
#include "actors/merge/gather_backend.h"

namespace moondb {

class FallbackGather final : public GatherBackend {
 public:
  using Make = std::function<Result<std::unique_ptr<GatherBackend>>()>;

  FallbackGather(std::unique_ptr<GatherBackend> first, Make make_again, int threads);

  // Errors: only that it was stopped.
  Result<void> Gather(std::span<const OrderedBlock> blocks, std::span<GatherWork> works,
                      const StopPredicate& stop) override;
  std::string name() const override { return first_ != nullptr ? first_->name() : cpu_.name(); }
  std::string description() const override;

 private:
  std::unique_ptr<GatherBackend> first_;  // Null: lost.
  const Make make_again_;
  CpuGather cpu_;
  std::string loss_;  // Why it was lost.
  int patience_ = 1;  // So many gathers pass until it is tried again, after the next loss.
  int gathers_left_ = 0;
};

}  // namespace moondb
