#include "actors/merge/gather_backend.h"

#include <utility>

#include "actors/merge/cpu_gather.h"
#include "actors/merge/egl_context.h"
#include "actors/merge/fallback_gather.h"
#include "actors/merge/gl_gather.h"

namespace moondb {

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

Result<std::unique_ptr<GatherBackend>> CreateGatherBackend(MergeBackend backend, int threads) {
  const auto make_gl = [threads]() -> Result<std::unique_ptr<GatherBackend>> {
    return GlGather::Create({.threads = threads});
  };
  if (ResolveMergeBackend(backend) == MergeBackend::kGl) {
    Result<std::unique_ptr<GatherBackend>> gl = make_gl();
    if (gl) return std::make_unique<FallbackGather>(std::move(*gl), make_gl, threads);
    if (backend == MergeBackend::kGl) return gl;
  }
  return std::make_unique<CpuGather>(CpuGather::Options{threads, nullptr});
}

}  // namespace moondb
