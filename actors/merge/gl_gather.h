// GlGather: the gather by OpenGL ES 3.1 (paper, Section 5.3), exact to the byte.
//
// The paper draws every layer over the whole map, the best one last. Here each square of 8 x 8 cells has a place in the
// target and a list of the blocks that may know something of it, the greatest key first. A fragment looks at a row of 8
// cells in one block after the other, by the CPU's integer additions, and stops when all are known. The lists are
// short, since most cells are known after very few blocks; what is still unknown when that is read back is drawn again,
// with longer ones.
//
// A tile that sees layers many times finer than the grid, which 32 bits cannot hold a square long, is gathered on the
// CPU.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "actors/merge/cpu_gather.h"
#include "actors/merge/gather_backend.h"

namespace moondb {

class EglContext;

class GlGather final : public GatherBackend {
 public:
  struct Options {
    std::int32_t target_cells_max = 4096;       // A side of one draw's target, at least 64; the driver's limit counts.
    std::int32_t atlas_page_texels_max = 1024;  // At least kBlockSideCellsMax.
    int threads = 1;                            // Of the CPU, for tiles that are gathered there.
    std::function<bool()> is_lost = {};         // For tests: asked before each draw; true is taken for a loss.
    std::function<double()> now_ms = {};        // For benchmarks: fills times(), and waits for the GPU at each step.
  };

  // Of the last Gather.
  struct Times {
    double upload_ms = 0;  // Of blocks and lists.
    double draw_ms = 0;
    double read_ms = 0;  // From the target to tiles.
  };

  // kUnavailable without a driver; kInternal if it does not take the shaders.
  static Result<std::unique_ptr<GlGather>> Create(Options options);
  ~GlGather() override;

  Result<void> Gather(std::span<const OrderedBlock> blocks, std::span<GatherWork> works,
                      const StopPredicate& stop) override;
  std::string name() const override { return "gl"; }
  std::string description() const override;

  const Times& times() const { return times_; }

 private:
  class Painter;
  GlGather(Options options, std::unique_ptr<EglContext> context);

  const Options options_;
  Times times_;
  std::unique_ptr<EglContext> context_;
  std::unique_ptr<Painter> painter_;  // All that needs the context to be current.
};

}  // namespace moondb
