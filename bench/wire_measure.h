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
  // Bytes of the whole mission, with framing, CURVE and acknowledgments.
  std::size_t paper_sql_bytes = 0;  // One acknowledged statement per record (actors/storage/paper_sql.h).
  std::size_t alone_bytes = 0;      // Rows in columns; maps in runs, coded without the previous map.
  std::size_t previous_bytes = 0;   // The same, coded with the previous map.
  std::size_t sent_bytes = 0;       // As sessions send it: with the previous map if that saves bytes.
  // Bytes of the cells of all maps, without any headers.
  std::size_t map_2bit_zstd_bytes = 0;
  std::size_t map_single_bytes = 0;    // Runs of one map.
  std::size_t map_batch_bytes = 0;     // Runs of 32 maps.
  std::size_t map_previous_bytes = 0;  // Runs of 32, coded with the previous map.
  // Processor time in milliseconds per map.
  double encode_ms = 0, decode_ms = 0, encode_previous_ms = 0, decode_previous_ms = 0;
  double sent_encode_ms = 0, sent_decode_ms = 0;  // As sessions send it: all records, per map.
};

// Processor time that coding takes.
struct CodingTimes {
  // One map of 4 x 100 x 100 cells, all known, with 1 % noise, as in RollingOptions.
  double map_encode_ms = 0, map_decode_ms = 0, map_encode_previous_ms = 0, map_decode_previous_ms = 0;
  // States and pose graph of a mission, in batches of one type with as many rows as a session requests.
  double encoded_rows_per_s = 0, decoded_rows_per_s = 0;
};

std::size_t RecordCount(const WireMission& mission);

// Returns WireSizes::paper_sql_bytes. Requires: every record has a statement (Check).
std::size_t PaperSqlBytes(const WireMission& mission);

// Also checks that everything decodes to the original (Check).
WireSizes MeasureMission(const WireMission& mission);

CodingTimes MeasureTimes(const WireMission& mission);

std::string TableOf(const std::vector<WireSizes>& sizes, const CodingTimes& times);
std::string JsonOf(const std::vector<WireSizes>& sizes, const CodingTimes& times);

}  // namespace moondb
