#include "actors/sharing/coding/batch_codec.h"

#include <algorithm>
#include <deque>
#include <functional>
#include <utility>
#include <vector>

#include "actors/sharing/coding/map_record.h"
#include "actors/sharing/coding/number_column.h"
#include "actors/sharing/coding/row_codec.h"
#include "actors/sharing/coding/zstd_frame.h"
#include "model/check.h"
#include "model/record_hash.h"
#include "proto/types.pb.h"

namespace moondb {

namespace {

constexpr std::size_t kHashBytes = 8;
constexpr std::size_t kChecksumBytes = 4;
// Rows of at most this many bytes are kept as the zstd prefix for the run's next batch.
constexpr std::size_t kRowsKeptMax = 64 * 1024;
constexpr std::size_t kHeadBytes = 48;  // Upper bound of the header bytes of an uncompressed batch.
// Coded bytes per content byte, assumed until the ratio of a data type was measured: kFrameRatioAtFirst for maps
// without their cells, kRowRatioAtFirst for all other records. A low kRowRatioAtFirst costs little time, because
// a batch without cells is coded again quickly if it does not fit.
constexpr double kRowRatioAtFirst = 0.1;
constexpr double kFrameRatioAtFirst = 0.5;

// Columns of the record fields other than the contents.
struct Columns {
  std::vector<std::uint64_t> origins, epochs, types, seqs, hashes, are_maps;

  static constexpr std::array<std::vector<std::uint64_t> Columns::*, 6> kAll = {
      &Columns::origins, &Columns::epochs, &Columns::types, &Columns::seqs, &Columns::hashes, &Columns::are_maps};
};

std::uint32_t Checksum(const std::vector<std::uint64_t>& hashes) {
  std::uint64_t all = hashes.size();
  for (const std::uint64_t hash : hashes) all = all * 0x9E3779B97F4A7C15u ^ hash;
  return static_cast<std::uint32_t>(all ^ all >> 32);
}

void PutReference(const MapReference& reference, std::string& bytes) {
  PutVarint(reference.key.stream.origin, bytes);
  PutFixed(reference.key.stream.epoch, kHashBytes, bytes);
  PutVarint(reference.key.stream.type, bytes);
  PutVarint(reference.key.seq, bytes);
  PutFixed(reference.hash, kHashBytes, bytes);
}

MapReference TakeReference(ByteReader& reader) {
  MapReference reference;
  reference.key.stream.origin = static_cast<AgentId>(reader.Varint());
  reference.key.stream.epoch = reader.Fixed(kHashBytes);
  reference.key.stream.type = static_cast<DataType>(reader.Varint());
  reference.key.seq = reader.Varint();
  reference.hash = reader.Fixed(kHashBytes);
  return reference;
}

enum MapsMark : std::uint64_t { kNoMaps = 0, kMapsOfRun = 1, kMapsWithReference = 2 };

struct Header {
  std::uint64_t maps = kNoMaps;
  std::uint64_t maps_before = 0;
  MapReference reference;
};

Error Corrupt(const char* text) { return Error{ErrorCode::kCorrupt, text, "coded"}; }

Result<Header> TakeHeader(ByteReader& reader) {
  Header header;
  header.maps = reader.Varint();
  if (header.maps > kMapsWithReference) reader.Fail();
  if (header.maps == kMapsOfRun) header.maps_before = reader.Varint();
  if (header.maps == kMapsWithReference) header.reference = TakeReference(reader);
  if (!reader.is_good()) return tl::unexpected(Corrupt("ends within its head"));
  return header;
}

RecordKey KeyAt(const Columns& columns, std::size_t i) {
  return {{static_cast<AgentId>(columns.origins[i]), columns.epochs[i], static_cast<DataType>(columns.types[i])},
          columns.seqs[i]};
}

void PutPacked(const std::string& plain, std::string_view before, std::string& bytes) {
  const std::optional<std::string> frame = CompressFrame(plain, FrameChecksum::kNone, before);
  const bool is_smaller = frame && frame->size() < plain.size();
  const std::string& packed = is_smaller ? *frame : plain;
  PutVarint(packed.size() * 2 + (is_smaller ? 1 : 0), bytes);
  bytes += packed;
}

Result<std::string> TakePacked(ByteReader& reader, std::string_view before) {
  const std::uint64_t mark = reader.Varint();
  const std::string_view packed = reader.Bytes(mark / 2);
  if (!reader.is_good()) return tl::unexpected(Corrupt("ends within its rows"));
  if (mark % 2 == 1) return DecompressFrame(packed, kBatchRowsBytesMax, before);
  if (packed.size() > kBatchRowsBytesMax) return tl::unexpected(Corrupt("has more than 20 MiB of rows"));
  return std::string(packed);
}

// The decoded rows of a batch.
struct Rows {
  std::string plain;  // The uncompressed bytes of all rows.
  std::uint32_t checksum = 0;
  Columns columns;
  std::vector<std::string> contents;  // Contents of the records, without map cells that are coded separately.
};

std::string WriteRows(const Columns& columns, std::uint32_t checksum, const std::vector<std::string_view>& contents) {
  std::string plain;
  PutVarint(contents.size(), plain);
  PutFixed(checksum, kChecksumBytes, plain);
  for (const auto column : Columns::kAll) PutColumn(columns.*column, plain);
  PutRows(contents, plain);
  return plain;
}

Result<Rows> TakeRowsOf(ByteReader& batch, std::uint32_t record_count, std::string_view before) {
  Result<std::string> plain = TakePacked(batch, before);
  if (!plain) return tl::unexpected(plain.error());
  Rows rows;
  rows.plain = *std::move(plain);
  ByteReader reader(rows.plain);
  if (reader.Varint() != record_count) return tl::unexpected(Corrupt("has another number of records than it states"));
  rows.checksum = static_cast<std::uint32_t>(reader.Fixed(kChecksumBytes));
  for (const auto column : Columns::kAll) rows.columns.*column = TakeColumn(record_count, reader);
  rows.contents = TakeRows(kBatchContentBytesMax, reader);
  if (!reader.is_good() || !reader.IsAtEnd() || rows.contents.size() != record_count) {
    return tl::unexpected(Corrupt("has rows that do not decode"));
  }
  for (std::size_t i = 0; i < record_count; ++i) {
    if (rows.columns.origins[i] > UINT32_MAX || rows.columns.types[i] > UINT32_MAX) {
      return tl::unexpected(Corrupt("has a key with a number that is too large"));
    }
  }
  return rows;
}

void KeepRows(std::string rows, std::string& kept) {
  kept = rows.size() <= kRowsKeptMax ? std::move(rows) : std::string();
}

// Decodes the cells and puts them back into the maps among the rows.
Result<void> JoinMaps(std::string_view cells, MapRunDecoder& run, Rows& rows, std::uint64_t& map_count) {
  std::vector<std::vector<MapLayer>> maps;
  for (std::size_t i = 0; i < rows.contents.size(); ++i) {
    if (rows.columns.are_maps[i] == 0) continue;
    Result<std::vector<MapLayer>> layers = LayersOfFrame(rows.contents[i]);
    if (!layers) return tl::unexpected(layers.error());
    maps.push_back(*std::move(layers));
  }
  std::vector<std::vector<MapLayer>*> pointers;
  for (auto& map : maps) pointers.push_back(&map);
  const Result<void> decoded = run.Decode(cells, pointers);
  if (!decoded) return decoded;
  map_count += maps.size();
  std::size_t next = 0;
  for (std::size_t i = 0; i < rows.contents.size(); ++i) {
    if (rows.columns.are_maps[i] == 0) continue;
    Result<std::string> content = JoinMap(rows.contents[i], maps[next++]);
    if (!content) return tl::unexpected(content.error());
    rows.contents[i] = *std::move(content);
  }
  return {};
}

// Makes the batch from its rows and checks the hashes against the checksum.
Result<proto::RecordBatch> ToBatch(Rows rows) {
  proto::RecordBatch batch;
  std::vector<std::uint64_t> hashes;
  for (std::size_t i = 0; i < rows.contents.size(); ++i) {
    const RecordKey key = KeyAt(rows.columns, i);
    proto::StoredRecord& record = *batch.add_records();
    *record.mutable_key() = ToProto(key);
    record.set_content(std::move(rows.contents[i]));
    record.set_hash(rows.columns.hashes[i] ^ HashRecord(key, record.content()));
    hashes.push_back(record.hash());
  }
  if (Checksum(hashes) != rows.checksum) return tl::unexpected(Corrupt("does not match its checksum"));
  return batch;
}

Result<proto::RecordBatch> DecodeRows(ByteReader& reader, std::uint32_t record_count) {
  Result<Rows> rows = TakeRowsOf(reader, record_count, {});
  if (!rows) return tl::unexpected(rows.error());
  if (!reader.IsAtEnd()) return tl::unexpected(Corrupt("has bytes after its end"));
  return ToBatch(*std::move(rows));
}

}  // namespace

BatchEncoder::BatchEncoder(MapRunEncoder::Previous previous) : previous_(previous) {}

void BatchEncoder::BeginRun(const proto::StoredRecord* reference) {
  maps_before_ = 0;
  rows_before_.clear();
  reference_.reset();
  const std::optional<SplitMap> map = reference ? SplitMapRecord(reference->content()) : std::nullopt;
  if (map) reference_ = MapReference{FromProto(reference->key()), reference->hash()};
  run_.reset();
  if (map) run_.emplace(previous_, &map->layers, trials_);
}

// The parts of the records of one batch, except the cells of its maps, which the run has already coded.
struct BatchEncoder::Parts {
  Columns columns;
  std::vector<std::uint64_t> hashes;
  std::deque<std::string> frames;  // Contents of maps without their cells. `contents` has views of these strings.
  std::vector<std::string_view> contents;
  std::size_t content_bytes = 0;
  std::uint64_t cell_count = 0;
  double row_bytes = kHeadBytes;  // Estimated coded bytes, without cells.
};

std::string BatchEncoder::Encode(const proto::RecordBatch& batch) {
  return EncodeUpTo(batch, static_cast<std::size_t>(batch.records_size()), SIZE_MAX).bytes;
}

CodedRows BatchEncoder::EncodeSome(const proto::RecordBatch& batch, std::size_t bytes_max) {
  // Encoding maps changes this encoder's map state (`run_`, `rows_before_`, `maps_before_`); encoding other records
  // does not. For a batch with maps, keep a copy of the encoder for another attempt.
  const auto is_map = [](const proto::StoredRecord& record) {
    return record.key().data_type() == proto::LOCAL_TRAVERSABILITY_MAP;
  };
  std::optional<BatchEncoder> start;
  if (std::any_of(batch.records().begin(), batch.records().end(), is_map)) start = *this;
  std::size_t records_max = static_cast<std::size_t>(batch.records_size());
  while (true) {
    CodedRows coded = EncodeUpTo(batch, records_max, bytes_max);
    if (coded.bytes.size() <= bytes_max || coded.record_count <= 1) return coded;
    // The rows turned out larger than estimated. For batches with maps, whose cells must be coded again, this is rare.
    records_max =
        std::clamp<std::size_t>(coded.record_count * bytes_max / coded.bytes.size(), 1, coded.record_count - 1);
    if (!start) continue;
    std::map<DataType, double> trained = std::move(row_ratios_);
    *this = *start;
    row_ratios_ = std::move(trained);
  }
}

CodedRows BatchEncoder::EncodeUpTo(const proto::RecordBatch& batch, std::size_t records_max, std::size_t bytes_max) {
  Parts parts;
  for (const proto::StoredRecord& record : batch.records()) {
    if (parts.contents.size() == records_max || !AddRecord(record, bytes_max, parts)) break;
  }
  const bool has_cells = !parts.frames.empty();
  const bool leans_on_others = has_cells && (maps_before_ > 0 || reference_);
  return {Finish(parts), parts.contents.size(), has_cells, leans_on_others};
}

bool BatchEncoder::AddRecord(const proto::StoredRecord& record, std::size_t bytes_max, Parts& parts) {
  const RecordKey key = FromProto(record.key());
  std::optional<SplitMap> map;
  if (key.stream.type == proto::LOCAL_TRAVERSABILITY_MAP) map = SplitMapRecord(record.content());
  const std::uint64_t cells = map ? CellCountOf(map->layers) : 0;
  if (parts.cell_count + cells > kCodedCellsMax) map.reset();
  const std::size_t content_bytes = map ? map->frame.size() : record.content().size();
  const auto known = row_ratios_.find(key.stream.type);
  const double at_first = map ? kFrameRatioAtFirst : kRowRatioAtFirst;
  const double ratio = known == row_ratios_.end() ? at_first : known->second;
  const double row_bytes = parts.row_bytes + static_cast<double>(content_bytes) * ratio;
  const auto fits = [&](std::size_t cell_bytes) {
    return parts.contents.empty() || row_bytes + static_cast<double>(cell_bytes) <= static_cast<double>(bytes_max);
  };
  if (!fits(CellBytes() + (map ? last_map_bytes_ : 0))) return false;
  if (map) {
    if (!run_) run_.emplace(previous_, nullptr, trials_);
    // Keep a copy of the run if the map would not fit with twice the bytes of the last map.
    const std::size_t bytes_before = CellBytes();
    std::optional<MapRunEncoder> before;
    if (!fits(bytes_before + 2 * last_map_bytes_)) before = run_;
    run_->Add(map->layers, key.stream.origin);
    trials_ = run_->trials();
    last_map_bytes_ = CellBytes() - bytes_before;
    if (before && !fits(CellBytes())) {
      run_ = std::move(before);
      return false;
    }
    parts.cell_count += cells;
    parts.frames.push_back(std::move(map->frame));
  }
  parts.columns.origins.push_back(key.stream.origin);
  parts.columns.epochs.push_back(key.stream.epoch);
  parts.columns.types.push_back(key.stream.type);
  parts.columns.seqs.push_back(key.seq);
  parts.columns.hashes.push_back(record.hash() ^ HashRecord(key, record.content()));
  parts.columns.are_maps.push_back(map ? 1 : 0);
  parts.hashes.push_back(record.hash());
  parts.contents.push_back(map ? std::string_view(parts.frames.back()) : std::string_view(record.content()));
  parts.content_bytes += content_bytes;
  parts.row_bytes = row_bytes;
  return true;
}

std::string BatchEncoder::Finish(const Parts& parts) {
  const bool has_maps = !parts.frames.empty();
  std::string bytes;
  PutMaps(parts.frames.size(), bytes);
  std::string rows = WriteRows(parts.columns, Checksum(parts.hashes), parts.contents);
  PutPacked(rows, has_maps ? rows_before_ : std::string_view(), bytes);
  LearnRowRatio(parts, bytes.size());
  if (!has_maps) return bytes;
  KeepRows(std::move(rows), rows_before_);
  bytes += run_->Finish();
  return bytes;
}

// Stores a ratio that is a tenth above the measured ratio. If an estimate is too low, the batch does not fit, and its
// maps must be coded again. An estimate that is too high costs less.
void BatchEncoder::LearnRowRatio(const Parts& parts, std::size_t packed_bytes) {
  const auto& types = parts.columns.types;
  const bool is_of_one_type = std::adjacent_find(types.begin(), types.end(), std::not_equal_to<>()) == types.end();
  if (parts.content_bytes == 0 || !is_of_one_type) return;
  const double row_bytes = std::max(static_cast<double>(packed_bytes) - kHeadBytes, 0.0);
  row_ratios_[static_cast<DataType>(types.front())] = 1.1 * row_bytes / static_cast<double>(parts.content_bytes);
}

void BatchEncoder::PutMaps(std::size_t map_count, std::string& bytes) {
  if (map_count == 0) {
    PutVarint(kNoMaps, bytes);
  } else if (maps_before_ == 0 && reference_) {
    PutVarint(kMapsWithReference, bytes);
    PutReference(*reference_, bytes);
  } else {
    PutVarint(kMapsOfRun, bytes);
    PutVarint(maps_before_, bytes);
  }
  maps_before_ += map_count;
}

Result<std::optional<MapReference>> ReferenceOf(std::string_view coded) {
  ByteReader reader(coded);
  const Result<Header> header = TakeHeader(reader);
  if (!header) return tl::unexpected(header.error());
  if (header->maps != kMapsWithReference) return std::optional<MapReference>();
  return std::optional<MapReference>(header->reference);
}

Result<proto::RecordBatch> BatchDecoder::Decode(std::string_view coded, std::uint32_t record_count,
                                                const proto::StoredRecord* reference) {
  if (record_count > kRowsMax) return Fail(ErrorCode::kCorrupt, "is above 4096", "record_count");
  ByteReader reader(coded);
  const Result<Header> header = TakeHeader(reader);
  if (!header) return tl::unexpected(header.error());
  if (header->maps == kNoMaps) return DecodeRows(reader, record_count);
  const Result<void> begun =
      header->maps == kMapsWithReference ? BeginRun(header->reference, reference) : ContinueRun(header->maps_before);
  if (!begun) return tl::unexpected(begun.error());
  // The run is restored below only if the whole batch decodes. After an error, the run has ended.
  std::optional<MapRunDecoder> run = std::exchange(run_, std::nullopt);
  Result<Rows> rows = TakeRowsOf(reader, record_count, rows_before_);
  if (!rows) return tl::unexpected(rows.error());
  const Result<void> joined = JoinMaps(reader.Bytes(reader.left()), *run, *rows, maps_before_);
  if (!joined) return tl::unexpected(joined.error());
  KeepRows(std::move(rows->plain), rows_before_);
  Result<proto::RecordBatch> batch = ToBatch(*std::move(rows));
  if (batch) run_ = std::move(run);
  return batch;
}

Result<void> BatchDecoder::BeginRun(const MapReference& wanted, const proto::StoredRecord* held) {
  const bool is_held = held && FromProto(held->key()) == wanted.key && held->hash() == wanted.hash;
  const std::optional<SplitMap> map = is_held ? SplitMapRecord(held->content()) : std::nullopt;
  if (!map) return Fail(ErrorCode::kNotFound, "refers to a map that the receiver does not hold", "coded");
  run_.emplace(&map->layers);
  maps_before_ = 0;
  rows_before_.clear();
  return {};
}

Result<void> BatchDecoder::ContinueRun(std::uint64_t maps_before) {
  if (maps_before == 0) {
    run_.emplace();
    maps_before_ = 0;
    rows_before_.clear();
  }
  if (!run_ || maps_before != maps_before_)
    return Fail(ErrorCode::kNotFound, "depends on earlier batches that are missing here", "coded");
  return {};
}

}  // namespace moondb
