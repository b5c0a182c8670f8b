#include "actors/sharing/coding/batch_codec.h"

#include <utility>
#include <vector>

#include "actors/sharing/coding/map_record.h"
#include "actors/sharing/coding/number_column.h"
#include "actors/sharing/coding/row_codec.h"
#include "actors/sharing/coding/zstd_frame.h"
#include "model/check.h"

namespace moondb {

namespace {

constexpr std::size_t kHashBytes = 8;
constexpr std::size_t kChecksumBytes = 4;
constexpr std::size_t kRowsKeptMax = 64 * 1024;  // Of a run's last batch, for the next one to refer to.

// What stands beside the contents, in columns.
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
  if (reader.Fixed(1) != kBatchFormatVersion) return tl::unexpected(Corrupt("is of a version that is not known here"));
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
  if (packed.size() > kBatchRowsBytesMax) return tl::unexpected(Corrupt("has more than 34 MiB of rows"));
  return std::string(packed);
}

// A batch's rows, taken apart.
struct Rows {
  std::string plain;  // What they were made of.
  std::uint32_t checksum = 0;
  Columns columns;
  std::vector<std::string> contents;  // Of maps whose cells are coded, their frames.
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
  if (reader.Varint() != record_count) return tl::unexpected(Corrupt("does not hold as many records as it should"));
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

// Puts the cells back into the rows' maps.
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

// Checks that all came back.
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
  if (!reader.IsAtEnd()) return tl::unexpected(Corrupt("has bytes behind its end"));
  return ToBatch(*std::move(rows));
}

}  // namespace

BatchEncoder::BatchEncoder(MapRunEncoder::Previous previous) : previous_(previous), run_(previous) {}

void BatchEncoder::BeginRun(const proto::StoredRecord* reference) {
  maps_before_ = 0;
  rows_before_.clear();
  reference_.reset();
  const std::optional<SplitMap> map = reference ? SplitMapRecord(reference->content()) : std::nullopt;
  if (map) reference_ = MapReference{FromProto(reference->key()), reference->hash()};
  run_ = MapRunEncoder(previous_, map ? &map->layers : nullptr);
}

std::string BatchEncoder::Encode(const proto::RecordBatch& batch) {
  Columns columns;
  std::vector<std::uint64_t> hashes;
  std::vector<SplitMap> maps;
  maps.reserve(static_cast<std::size_t>(batch.records_size()));  // Contents refer to them.
  std::vector<std::string_view> contents;
  std::uint64_t cell_count = 0;
  for (const proto::StoredRecord& record : batch.records()) {
    const RecordKey key = FromProto(record.key());
    columns.origins.push_back(key.stream.origin);
    columns.epochs.push_back(key.stream.epoch);
    columns.types.push_back(key.stream.type);
    columns.seqs.push_back(key.seq);
    columns.hashes.push_back(record.hash() ^ HashRecord(key, record.content()));
    hashes.push_back(record.hash());
    contents.push_back(record.content());
    std::optional<SplitMap> map;
    if (key.stream.type == proto::LOCAL_TRAVERSABILITY_MAP) map = SplitMapRecord(record.content());
    const std::uint64_t cells = map ? CellCountOf(map->layers) : 0;
    const bool is_coded = map && cell_count + cells <= kCodedCellsMax;
    columns.are_maps.push_back(is_coded ? 1 : 0);
    if (!is_coded) continue;
    cell_count += cells;
    maps.push_back(*std::move(map));
    contents.back() = maps.back().frame;
    run_.Add(maps.back().layers, key.stream.origin);
  }
  std::string bytes(1, static_cast<char>(kBatchFormatVersion));
  PutMaps(maps.size(), bytes);
  std::string rows = WriteRows(columns, Checksum(hashes), contents);
  PutPacked(rows, maps.empty() ? std::string_view() : rows_before_, bytes);
  if (maps.empty()) return bytes;
  KeepRows(std::move(rows), rows_before_);
  bytes += run_.Finish();
  return bytes;
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
  // Back in its place only when all went well: a run that lost its way has ended.
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
  if (!map) return Fail(ErrorCode::kNotFound, "refers to a map that is not held", "coded");
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
    return Fail(ErrorCode::kNotFound, "follows batches that are not here", "coded");
  return {};
}

}  // namespace moondb
