// Merges one world of merge_bench with all contenders in turn.
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

// Results for one world. Times are medians in milliseconds; null if this build or this machine lacks the contender.
struct MergeRun {
  std::size_t maps = 0;
  std::int64_t side_cells = 0;
  std::uint64_t extent_cells = 0;  // Cells in the bounding box of all maps.
  double naive_ms = 0;             // The naive merger in metres and doubles.
  double naive_integer_ms = 0;     // The naive merger with the integers of moondb's placement.
  std::optional<double> opencv_ms;
  std::optional<double> painter_ms;
  std::optional<double> gl_ms;
  double cpu_ms = 0;  // moondb's CPU backend with the best instruction set and all threads.
  double cpu_one_thread_ms = 0;
  // Time of the first merge, with all threads and in newly allocated memory.
  double cpu_first_ms = 0;
  // moondb's CPU backend with each instruction set, on one thread.
  std::optional<double> cpu_avx512_ms;
  std::optional<double> cpu_avx2_ms;
  std::optional<double> cpu_sse2_ms;
  double cpu_scalar_ms = 0;
  double incremental_cpu_ms = 0;  // Time to add a map and its footprint, on one thread.
  std::optional<double> incremental_gl_ms;
  double withdraw_cpu_ms = 0;  // Time to remove one map.
  double move_cpu_ms = 0;      // Time to move one map.
  // Times for one new record, from the record to the tiles (carried_merge.h); null for too few maps.
  std::optional<double> record_map_ms;
  std::optional<double> record_pose_ms;
  // Durations of the steps of a merge with OpenGL.
  std::optional<double> gl_upload_ms;
  std::optional<double> gl_draw_ms;
  std::optional<double> gl_read_ms;
  std::optional<double> gl_maps_upload_ms;  // Time of the first upload of all maps to the GPU.
  double local_map_ms = 0;                  // Time to pack one map on its arrival.
  double read_cells_ms = 0;                 // Time to read the whole merged map as a grid.
  // Fraction of a contender's cells that have the same value as in the naive merger with integers, among the cells that
  // are known in at least one of the two maps. The three contenders place layers with floats or doubles, so some of
  // their cells on borders differ.
  double naive_agrees = 0;
  std::optional<double> opencv_agrees;
  std::optional<double> painter_agrees;
  // Memory of the maps and their placement, divided by the size of the maps at 2 bits per cell.
  double memory_ratio = 0;
  double pages_mb = 0;
  std::string gl_description;
  std::string cpu_description;
};

// Fails with kInternal if two mergers with integers differ in any cell, or if a merger with floats or doubles agrees in
// too few cells. Also fails if the OpenGL driver reports an error.
Result<MergeRun> RunMergeContest(const MergeContestOptions& options);

}  // namespace moondb
