// What a mission takes on the wire in each encoding, for wire_bench.
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
  // The whole mission, with framing, CURVE and acknowledgments.
  std::size_t paper_sql_bytes = 0;  // One populated statement a record (actors/storage/paper_sql.h), each acknowledged.
  std::size_t alone_bytes = 0;      // Rows in columns, maps in runs, each without its previous map.
  std::size_t previous_bytes = 0;   // The same with it.
  std::size_t sent_bytes = 0;       // As sessions send it: the previous map while it pays.
  // The cells of all maps, without anything around them.
  std::size_t map_2bit_zstd_bytes = 0;
  std::size_t map_single_bytes = 0;    // One map a run,
  std::size_t map_batch_bytes = 0;     // runs of 32,
  std::size_t map_previous_bytes = 0;  // and with the previous map.
  // Of one map, of the processor's time.
  double encode_ms = 0, decode_ms = 0, encode_previous_ms = 0, decode_previous_ms = 0;
  double sent_encode_ms = 0, sent_decode_ms = 0;  // As sessions send it; all records of the mission, by its maps.
};

// How long coding takes, of the processor's time.
struct CodingTimes {
  // Of one map of 4 x 100 x 100 cells, all known, with 1 % noise, as RollingOptions has it.
  double map_encode_ms = 0, map_decode_ms = 0, map_encode_previous_ms = 0, map_decode_previous_ms = 0;
  // Of a mission's states and pose graph, in batches of one type that hold as many as a session asks for.
  double encoded_rows_per_s = 0, decoded_rows_per_s = 0;
};

std::size_t RecordCount(const WireMission& mission);

// WireSizes::paper_sql_bytes. Check stops where a record has no statement.
std::size_t PaperSqlBytes(const WireMission& mission);

// Checks on the way that everything comes back; Check stops where it does not.
WireSizes MeasureMission(const WireMission& mission);

CodingTimes MeasureTimes(const WireMission& mission);

std::string TableOf(const std::vector<WireSizes>& sizes, const CodingTimes& times);
std::string JsonOf(const std::vector<WireSizes>& sizes, const CodingTimes& times);

}  // namespace moondb
