// GlGather: gathers with OpenGL ES 3.1 (paper, Section 5.3). The result is identical to the CPU's, byte for byte.
//
// The paper's painter's algorithm draws every layer over the whole map, the best layer last. GlGather instead draws
// squares of 8 x 8 cells. Each square has a list of blocks that may know some of its cells, in the order of descending
// keys. A fragment evaluates a row of 8 cells, block by block, with the same integer additions as the CPU, and stops
// when all 8 cells are known. Squares that still have unknown cells after readback are drawn again with longer lists.
//
// Tiles that see layers many times finer than the grid are gathered on the CPU, because 32-bit coordinates cannot span
// a square of such a layer.
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
    // Maximum width and height of the render target in cells, at least 64. The driver's limits may be lower.
    std::int32_t target_cells_max = 4096;
    // Maximum side of an atlas page in texels, at least kBlockSideCellsMax.
    std::int32_t atlas_page_texels_max = 1024;
    int threads = 1;                     // Number of CPU threads for tiles gathered on the CPU.
    std::function<bool()> is_lost = {};  // For tests: called before each draw; true simulates a lost context.
    // Returns the time in milliseconds, for times(). If set, each step waits for the GPU; set it only in benchmarks.
    std::function<double()> now_ms = {};
  };

  // Time spent in each step of the last Gather.
  struct Times {
    double upload_ms = 0;  // Time to build and upload the squares' lists of blocks, and to upload blocks.
    double draw_ms = 0;
    double read_ms = 0;  // Time to read back the render target and copy its pixels to tiles.
  };

  // Returns kUnavailable without a driver, and kInternal if the driver rejects the shaders.
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
  std::unique_ptr<Painter> painter_;  // All state that needs a current context.
};

}  // namespace moondb
