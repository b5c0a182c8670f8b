// FallbackGather: a backend that may fail, with the CPU as fallback.
//
// If the first backend fails, it is destroyed and the CPU gathers the same tiles immediately. The next gather tries to
// create the first backend again. After repeated failures the tries become rarer, up to one in 64 gathers.
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

  // Fails only if `stop` returned true.
  Result<void> Gather(std::span<const OrderedBlock> blocks, std::span<GatherWork> works,
                      const StopPredicate& stop) override;
  std::string name() const override { return first_ != nullptr ? first_->name() : cpu_.name(); }
  std::string description() const override;

 private:
  std::unique_ptr<GatherBackend> first_;  // Null while the first backend is lost.
  const Make make_again_;
  CpuGather cpu_;
  std::string loss_;  // Reason of the last failure.
  // Number of gathers from the next failure until the first backend is created again. 1: the next gather creates it.
  int patience_ = 1;
  int gathers_left_ = 0;
};

}  // namespace moondb
