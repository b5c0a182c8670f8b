// The compact form of batches of records: rows in columns (row_codec.h), and the cells of maps by the map codec
// (map_codec.h), whose runs go on from batch to batch.
//
//   batch   := maps, size of rows * 2 + (1: as a zstd frame), rows, cells
//   maps    := 0: no cells are coded | 1, maps before | 2, the reference: begins a run
//   rows    := record count, checksum, contents (row_codec.h) behind columns (number_column.h) of origins,
//              epochs, types, seqs, hashes and "its cells are coded"
//
// The frame of a run's later batch refers to the rows of the one before. Those of a run's batches that have coded cells
// must be decoded in the order in which they were encoded: each says how many such maps came before it, and a decoder
// that has seen another number refuses it. So a sender that was cut off begins anew, as does one that wants a batch to
// be decodable on its own; where a batch says 0 the decoder does so too.
//
// Every content comes back byte for byte, or decoding fails: a map's record is taken apart only where joining it gives
// the same bytes (map_record.h), other contents are taken apart into whatever they are made of, hashes are sent as what
// they differ from HashRecord (mostly nothing), and the checksum covers all hashes. The records themselves are checked
// by nobody here. Not thread-safe; both ends can be copied, for a trial.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "actors/sharing/coding/map_codec.h"
#include "model/error.h"
#include "model/record_key.h"
#include "proto/record.pb.h"

namespace moondb {

inline constexpr std::size_t kBatchContentBytesMax = 18 * 1024 * 1024;
// Before zstd: the contents and what is beside them.
inline constexpr std::size_t kBatchRowsBytesMax = 20 * 1024 * 1024;

// A map that both ends hold.
struct MapReference {
  RecordKey key;
  std::uint64_t hash = 0;
  bool operator==(const MapReference&) const = default;
};

// Some first records of a batch.
struct CodedRows {
  std::string bytes;
  std::size_t record_count = 0;
  bool has_cells = false;        // Of maps: it is a part of the run.
  bool leans_on_others = false;  // It cannot be decoded without the run's batches before.
};

class BatchEncoder {
 public:
  explicit BatchEncoder(MapRunEncoder::Previous previous);

  // The next batch is decodable without the ones before. With a reference, only where that map is held: `reference`
  // must then be a map's record; it is not used if the map codec cannot take it.
  void BeginRun(const proto::StoredRecord* reference = nullptr);

  // At most kRowsMax records, whose contents have at most kBatchContentBytesMax bytes. Unknown fields of the stored
  // records themselves, outside of their contents, are left out.
  std::string Encode(const proto::RecordBatch& batch);

  // As many of the first records as fit into `bytes_max`, give or take one, and at least one, whatever its size. Takes
  // hardly longer than to encode these alone: maps are coded one after the other until no other is expected to fit,
  // rows are estimated by how the last ones of their type turned out.
  CodedRows EncodeSome(const proto::RecordBatch& batch, std::size_t bytes_max);

 private:
  struct Parts;

  CodedRows EncodeUpTo(const proto::RecordBatch& batch, std::size_t records_max, std::size_t bytes_max);
  // False: with it the bytes are too many; it was not added.
  bool AddRecord(const proto::StoredRecord& record, std::size_t bytes_max, Parts& parts);
  std::string Finish(const Parts& parts);
  void PutMaps(std::size_t map_count, std::string& bytes);
  std::size_t CellBytes() const { return run_ ? run_->byte_count() : 0; }
  void LearnRowRatio(const Parts& parts, std::size_t packed_bytes);

  MapRunEncoder::Previous previous_;
  PreviousTrials trials_;
  std::optional<MapRunEncoder> run_;  // From its first map or reference on.
  std::optional<MapReference> reference_;
  std::uint64_t maps_before_ = 0;
  std::string rows_before_;
  // For estimates: packed bytes a byte of content, without cells, by data type; bytes of the last map's cells.
  std::map<DataType, double> row_ratios_;
  std::size_t last_map_bytes_ = 0;
};

// The map that must be held to decode this batch; nothing: none. kCorrupt where it cannot be read.
Result<std::optional<MapReference>> ReferenceOf(std::string_view coded);

class BatchDecoder {
 public:
  // kCorrupt: does not decode, is beyond a limit, does not match its checksum, or
  // has another number of records than `record_count`. kNotFound: batches before it are missing, or the map that it
  // refers to is not `reference`; the sender has to begin anew. When cells do not decode, the run has ended.
  Result<proto::RecordBatch> Decode(std::string_view coded, std::uint32_t record_count,
                                    const proto::StoredRecord* reference = nullptr);

 private:
  Result<void> BeginRun(const MapReference& wanted, const proto::StoredRecord* held);
  Result<void> ContinueRun(std::uint64_t maps_before);

  std::optional<MapRunDecoder> run_;
  std::uint64_t maps_before_ = 0;
  std::string rows_before_;
};

}  // namespace moondb
