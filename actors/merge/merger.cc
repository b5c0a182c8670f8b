#include "actors/merge/merger.h"

#include <utility>

#include "actors/merge/cpu_merger.h"
#include "actors/merge/egl_context.h"
#include "actors/merge/gl_merger.h"

namespace moondb {

Result<std::unique_ptr<Merger>> CreateMerger(MergeBackend backend) {
  if (ResolveMergeBackend(backend) == MergeBackend::kCpu) return std::make_unique<CpuMerger>();
  Result<std::unique_ptr<GlMerger>> gl = GlMerger::Create({});
  if (gl) return std::move(*gl);
  if (backend == MergeBackend::kAuto) return std::make_unique<CpuMerger>();
  return tl::unexpected(gl.error());
}

bool MergeResult::operator==(const MergeResult& other) const {
  return merged.grid == other.merged.grid && merged.resolution_um == other.merged.resolution_um &&
         merged.origin_cell_x == other.merged.origin_cell_x && merged.origin_cell_y == other.merged.origin_cell_y &&
         slots == other.slots && levels == other.levels;
}

std::string ToString(MergeBackend backend) {
  switch (backend) {
    case MergeBackend::kAuto:
      return "auto";
    case MergeBackend::kCpu:
      return "cpu";
    case MergeBackend::kGl:
      return "gl";
  }
  return "unknown";
}

Result<MergeBackend> ParseMergeBackend(std::string_view text) {
  for (const MergeBackend backend : {MergeBackend::kAuto, MergeBackend::kCpu, MergeBackend::kGl}) {
    if (text == ToString(backend)) return backend;
  }
  return Fail(ErrorCode::kInvalid, "must be auto, cpu or gl");
}

MergeBackend ResolveMergeBackend(MergeBackend backend) {
  if (backend != MergeBackend::kAuto) return backend;
  const Result<std::unique_ptr<EglContext>> context = EglContext::Create();
  return context && !(*context)->is_software() ? MergeBackend::kGl : MergeBackend::kCpu;
}

MergeResult MakeEmptyResult(const MapPlacement& placement) {
  MergeResult result;
  const CellBox& extent = placement.extent;
  const auto width = static_cast<std::int32_t>(extent.width());
  const auto height = static_cast<std::int32_t>(extent.height());
  result.merged.grid = Grid(width, height);
  result.merged.resolution_um = placement.resolution_um;
  if (!extent.is_empty()) {
    result.merged.origin_cell_x = extent.first_x;
    result.merged.origin_cell_y = extent.first_y;
  }
  const std::size_t cells = static_cast<std::size_t>(width) * height;
  result.slots.assign(cells, kNoSlot);
  result.levels.assign(cells, 0);
  return result;
}

}  // namespace moondb
