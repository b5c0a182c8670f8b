#include "bench/merge_report.h"

#include <fmt/format.h>

#include <array>
#include <functional>

namespace moondb {
namespace {

struct Column {
  const char* name;
  std::function<std::optional<double>(const MergeRun&)> value;
};

const std::vector<Column>& Columns() {
  static const std::vector<Column> columns = {
      {"naive_ms", [](const MergeRun& run) { return run.naive_ms; }},
      {"naive_integer_ms", [](const MergeRun& run) { return run.naive_integer_ms; }},
      {"opencv_ms", [](const MergeRun& run) { return run.opencv_ms; }},
      {"painter_ms", [](const MergeRun& run) { return run.painter_ms; }},
      {"gl_ms", [](const MergeRun& run) { return run.gl_ms; }},
      {"cpu_ms", [](const MergeRun& run) { return run.cpu_ms; }},
      {"cpu_one_thread_ms", [](const MergeRun& run) { return run.cpu_one_thread_ms; }},
      {"cpu_first_ms", [](const MergeRun& run) { return run.cpu_first_ms; }},
      {"cpu_avx512_ms", [](const MergeRun& run) { return run.cpu_avx512_ms; }},
      {"cpu_avx2_ms", [](const MergeRun& run) { return run.cpu_avx2_ms; }},
      {"cpu_sse2_ms", [](const MergeRun& run) { return run.cpu_sse2_ms; }},
      {"cpu_scalar_ms", [](const MergeRun& run) { return run.cpu_scalar_ms; }},
      {"incremental_cpu_ms", [](const MergeRun& run) { return run.incremental_cpu_ms; }},
      {"incremental_gl_ms", [](const MergeRun& run) { return run.incremental_gl_ms; }},
      {"withdraw_cpu_ms", [](const MergeRun& run) { return run.withdraw_cpu_ms; }},
      {"move_cpu_ms", [](const MergeRun& run) { return run.move_cpu_ms; }},
      {"record_map_ms", [](const MergeRun& run) { return run.record_map_ms; }},
      {"record_pose_ms", [](const MergeRun& run) { return run.record_pose_ms; }},
      {"gl_upload_ms", [](const MergeRun& run) { return run.gl_upload_ms; }},
      {"gl_draw_ms", [](const MergeRun& run) { return run.gl_draw_ms; }},
      {"gl_read_ms", [](const MergeRun& run) { return run.gl_read_ms; }},
      {"gl_maps_upload_ms", [](const MergeRun& run) { return run.gl_maps_upload_ms; }},
      {"local_map_ms", [](const MergeRun& run) { return run.local_map_ms; }},
      {"read_cells_ms", [](const MergeRun& run) { return run.read_cells_ms; }},
  };
  return columns;
}

// Returns the columns with the fraction of cells that agree with the naive merger.
const std::vector<Column>& Agreements() {
  static const std::vector<Column> columns = {
      {"naive_agrees", [](const MergeRun& run) { return run.naive_agrees; }},
      {"opencv_agrees", [](const MergeRun& run) { return run.opencv_agrees; }},
      {"painter_agrees", [](const MergeRun& run) { return run.painter_agrees; }},
  };
  return columns;
}

std::string JsonOf(const std::vector<Column>& columns, const MergeRun& run) {
  std::string text;
  for (const Column& column : columns) {
    const std::optional<double> value = column.value(run);
    text += fmt::format(", \"{}\": {}", column.name, value ? fmt::format("{:.6g}", *value) : "null");
  }
  return text;
}

std::string JsonOf(const MergeRun& run) {
  std::string text = fmt::format("{{\"maps\": {}, \"side_cells\": {}, \"extent_cells\": {}", run.maps, run.side_cells,
                                 run.extent_cells);
  text += JsonOf(Columns(), run) + JsonOf(Agreements(), run);
  return text + fmt::format(", \"memory_ratio\": {:.4g}, \"pages_mb\": {:.4g}, \"gl\": \"{}\", \"cpu\": \"{}\"}}",
                            run.memory_ratio, run.pages_mb, run.gl_description, run.cpu_description);
}

std::string JsonOf(const std::vector<MergeRun>& runs) {
  std::vector<std::string> texts;
  for (const MergeRun& run : runs) texts.push_back(JsonOf(run));
  return fmt::format("[\n    {}]", fmt::join(texts, ",\n    "));
}

}  // namespace

std::string TableOf(const std::vector<MergeRun>& runs) {
  std::string text;
  for (const MergeRun& run : runs) {
    text += fmt::format("{} maps, square of {} cells, {} cells in all; {}; {}\n", run.maps, run.side_cells,
                        run.extent_cells, run.cpu_description, run.gl_description);
    for (const Column& column : Columns()) {
      const std::optional<double> value = column.value(run);
      if (!value) continue;
      text += fmt::format("  {:<20}{:>12.4g}   naive is {:.4g} x this, naive in integers {:.4g} x\n", column.name,
                          *value, run.naive_ms / *value, run.naive_integer_ms / *value);
    }
    for (const Column& column : Agreements()) {
      const std::optional<double> value = column.value(run);
      if (value) text += fmt::format("  {:<20}{:>12.6f}   of the known cells\n", column.name, *value);
    }
    text += fmt::format("  maps in memory: {:.3g} x what 2 bits a cell take; pages {:.3g} MB\n", run.memory_ratio,
                        run.pages_mb);
  }
  return text;
}

std::string JsonOf(const std::vector<MergeRun>& runs, const std::vector<MergeRun>& growth) {
  return fmt::format("{{\n  \"runs\": {},\n  \"growth\": {}\n}}\n", JsonOf(runs), JsonOf(growth));
}

}  // namespace moondb
