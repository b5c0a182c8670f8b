// One world of merge_bench, merged by all contenders in turn.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "model/error.h"

namespace moondb {

struct MergeContestOptions {
  std::size_t maps = 100;
  std::int64_t side_cells = 2000;
  int repetitions = 5;
  int threads = 1;
};

// Medians, in milliseconds; none: not in this build or on this machine.
struct MergeRun {
  std::size_t maps = 0;
  std::int64_t side_cells = 0;
  std::uint64_t extent_cells = 0;  // Of the bounding box of all maps.
  double naive_ms = 0;             // In metres and doubles, as one writes it first.
  double naive_integer_ms = 0;     // With the integers of moondb's own placement.
  std::optional<double> opencv_ms;
  std::optional<double> painter_ms;
  std::optional<double> gl_ms;
  double cpu_ms = 0;  // With the best instructions and all threads.
  double cpu_one_thread_ms = 0;
  double cpu_first_ms = 0;              // All threads; the first merge, in fresh memory.
  std::optional<double> cpu_avx512_ms;  // These with one thread.
  std::optional<double> cpu_avx2_ms;
  std::optional<double> cpu_sse2_ms;
  double cpu_scalar_ms = 0;
  double incremental_cpu_ms = 0;  // One more map, and its footprint; one thread.
  std::optional<double> incremental_gl_ms;
  double withdraw_cpu_ms = 0;  // One map less.
  double move_cpu_ms = 0;      // One map elsewhere.
  // Of gl_ms.
  std::optional<double> gl_upload_ms;
  std::optional<double> gl_draw_ms;
  std::optional<double> gl_read_ms;
  std::optional<double> gl_maps_upload_ms;  // Once, when all maps are new.
  double local_map_ms = 0;                  // To pack one map when it arrives.
  double read_cells_ms = 0;                 // The whole merged map as a grid.
  // Of the cells that are known to the naive merger in integers or to these, the share with the same value. They place
  // by floats or doubles, and differ in cells on borders.
  double naive_agrees = 0;
  std::optional<double> opencv_agrees;
  std::optional<double> painter_agrees;
  double memory_ratio = 0;  // Of the maps at 2 bits a cell; without pages.
  double pages_mb = 0;
  std::string gl_description;
  std::string cpu_description;
};

// kInternal if two that should agree in every cell do not, or others in fewer than they can; a driver's errors.
Result<MergeRun> RunMergeContest(const MergeContestOptions& options);

}  // namespace moondb
