// Measures the bytes of a mission on the wire in each encoding, for wire_bench.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "bench/wire_mission.h"

namespace moondb {

struct WireSizes {
  std::string name;
  std::size_t record_count = 0;
  std::size_t map_count = 0;
  // Sizes of the whole mission on the wire, in bytes, with framing, CURVE and acknowledgments.
  std::size_t paper_sql_bytes = 0;  // One acknowledged statement per record (actors/storage/paper_sql.h).
  std::size_t alone_bytes = 0;      // Compact encoding; no map is coded with the previous map as context.
  std::size_t previous_bytes = 0;   // Like alone_bytes, with each map coded by the previous map if that is smaller.
  // Size of the mission as sessions send it (MapRunEncoder::Previous::kWhileItPays). Like previous_bytes, but some maps
  // are coded in only one of the two ways (with or without the previous map), to save time.
  std::size_t sent_bytes = 0;
  // Sizes of the cells of all maps, in bytes, without headers.
  std::size_t map_2bit_zstd_bytes = 0;
  std::size_t map_single_bytes = 0;    // Each map coded as a separate run.
  std::size_t map_batch_bytes = 0;     // Maps coded in runs of 32; no map is coded with the previous map as context.
  std::size_t map_previous_bytes = 0;  // Like map_batch_bytes, with the previous map as context if that is smaller.
  // Processor time per map, in milliseconds.
  double encode_ms = 0, decode_ms = 0, encode_previous_ms = 0, decode_previous_ms = 0;
  // Processor time to code and decode all records of the mission as sessions do, in milliseconds per map.
  double sent_encode_ms = 0, sent_decode_ms = 0;
};

struct CodingTimes {
  // Milliseconds per map of 4 x 100 x 100 cells, all known, with 1 % noise (RollingOptions).
  double map_encode_ms = 0, map_decode_ms = 0, map_encode_previous_ms = 0, map_decode_previous_ms = 0;
  // Rows per second of the states and the pose graph of a mission, in batches of one type with as many rows as a
  // session requests at once.
  double encoded_rows_per_s = 0, decoded_rows_per_s = 0;
};

std::size_t RecordCount(const WireMission& mission);

// Returns WireSizes::paper_sql_bytes. Requires: SqlOf returns a statement for every record; otherwise Check fails.
std::size_t PaperSqlBytes(const WireMission& mission);

// Measures all sizes of a mission. Check fails if decoding does not restore the original.
WireSizes MeasureMission(const WireMission& mission);

CodingTimes MeasureTimes(const WireMission& mission);

std::string TableOf(const std::vector<WireSizes>& sizes, const CodingTimes& times);
std::string JsonOf(const std::vector<WireSizes>& sizes, const CodingTimes& times);

}  // namespace moondb
