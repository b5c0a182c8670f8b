// The compact form of a batch of records. It contains the records as rows, stored column by column (row_codec.h), and
// the cells of maps, coded by the map codec (map_codec.h). The map codec's runs continue from batch to batch.
//
//   batch   := maps, size of rows * 2 + (1: as a zstd frame), rows, cells
//   maps    := 0: no cells are coded | 1, number of earlier maps of the run | 2, reference: begins a run
//   rows    := record count, checksum, columns (number_column.h) of origins, epochs, types, seqs, hashes
//              and "the cells of this record are coded", then the contents (row_codec.h)
//
// In a run, the zstd frame of a batch refers to the rows of the previous batch. Batches with coded cells must be
// decoded in the order of encoding. Each such batch contains the number of earlier maps of the run. A decoder that has
// decoded another number of maps refuses the batch. A batch with 0 earlier maps begins a new run.
//
// Decoding restores every content byte for byte, or fails. In place of a record's hash, the batch contains the XOR of
// the hash and HashRecord, which is nearly always 0. The checksum covers all hashes. The codec does not validate the
// records. Not thread-safe. Encoder and decoder can be copied for a trial.
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
// Limit in bytes of the uncompressed rows, which are the contents and the columns.
inline constexpr std::size_t kBatchRowsBytesMax = 20 * 1024 * 1024;

// Identifies a map that encoder and decoder both hold.
struct MapReference {
  RecordKey key;
  std::uint64_t hash = 0;
  bool operator==(const MapReference&) const = default;
};

// The coded form of the first `record_count` records of a batch.
struct CodedRows {
  std::string bytes;
  std::size_t record_count = 0;
  bool has_cells = false;        // The batch has coded cells of maps, so it belongs to the run.
  bool leans_on_others = false;  // The batch can be decoded only after the earlier batches of its run.
};

class BatchEncoder {
 public:
  explicit BatchEncoder(MapRunEncoder::Previous previous);

  // Begins a new run, so the next batch can be decoded without earlier batches. With a reference, only a decoder that
  // gets the same map can decode the next batch. Requires: `reference` is a map's record or null. A reference that the
  // map codec cannot code is ignored.
  void BeginRun(const proto::StoredRecord* reference = nullptr);

  // Encodes a whole batch. Requires: at most kRowsMax records, with at most kBatchContentBytesMax bytes of contents.
  // Unknown protobuf fields of a StoredRecord, outside of its content, are lost.
  std::string Encode(const proto::RecordBatch& batch);

  // Encodes about as many of the first records as fit into `bytes_max` bytes, but at least one. The result exceeds
  // `bytes_max` only if it contains a single record. Codes maps one by one until the next map is not expected to fit.
  CodedRows EncodeSome(const proto::RecordBatch& batch, std::size_t bytes_max);

 private:
  struct Parts;

  CodedRows EncodeUpTo(const proto::RecordBatch& batch, std::size_t records_max, std::size_t bytes_max);
  // Adds a record. Returns false, and adds nothing, if the batch would exceed `bytes_max`.
  bool AddRecord(const proto::StoredRecord& record, std::size_t bytes_max, Parts& parts);
  std::string Finish(const Parts& parts);
  void PutMaps(std::size_t map_count, std::string& bytes);
  std::size_t CellBytes() const { return run_ ? run_->byte_count() : 0; }
  void LearnRowRatio(const Parts& parts, std::size_t packed_bytes);

  MapRunEncoder::Previous previous_;
  PreviousTrials trials_;
  std::optional<MapRunEncoder> run_;  // Set once the run has a map or a reference.
  std::optional<MapReference> reference_;
  std::uint64_t maps_before_ = 0;
  std::string rows_before_;
  // For size estimates: the compressed bytes per content byte, without cells, for each data type.
  std::map<DataType, double> row_ratios_;
  std::size_t last_map_bytes_ = 0;
};

// Returns the map that a decoder must hold to decode this batch, or nullopt if the batch refers to no map. Returns
// kCorrupt if the batch's header is malformed.
Result<std::optional<MapReference>> ReferenceOf(std::string_view coded);

class BatchDecoder {
 public:
  // Decodes a batch. Returns kCorrupt if the batch does not decode, exceeds a limit, does not match its checksum, or
  // has another number of records than `record_count`. Returns kNotFound if earlier batches of its run are missing, or
  // if the batch refers to another map than `reference`; the sender must then begin a new run. If the cells do not
  // decode, the run has ended.
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
