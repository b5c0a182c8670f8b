#include "tests/fuzz/decoders.h"

#include <string>
#include <utility>

#include "actors/sharing/codec.h"
#include "actors/sharing/coding/byte_text.h"
#include "actors/sharing/coding/map_record.h"
#include "actors/sharing/coding/row_codec.h"
#include "actors/storage/paper_sql.h"
#include "model/check.h"
#include "tests/fuzz/peer_decoders.h"

namespace moondb {
namespace {

void CheckCodesAgain(const proto::RecordBatch& batch) {
  const std::string coded = BatchEncoder(MapRunEncoder::Previous::kNever).Encode(batch);
  const auto decoded = BatchDecoder().Decode(coded, static_cast<std::uint32_t>(batch.records_size()));
  Check(decoded && decoded->SerializeAsString() == batch.SerializeAsString(), "a batch comes back when coded again");
}

// Input: record count (2 bytes), coded bytes.
void RunBatch(std::string_view bytes) {
  const auto count = static_cast<std::uint32_t>(TakeNumber(2, bytes));
  const auto batch = DecodeBatch(proto::CODEC_COMPACT, bytes, count);
  if (batch) CheckCodesAgain(*batch);
}

// Input: the batches of one compression run, each with record count (1 byte), size (2 bytes) and coded bytes.
void RunRun(std::string_view bytes) {
  BatchDecoder decoder;
  while (!bytes.empty()) {
    const auto count = static_cast<std::uint32_t>(TakeNumber(1, bytes));
    const std::size_t size = TakeNumber(2, bytes);
    (void)decoder.Decode(bytes.substr(0, size), count);
    bytes.remove_prefix(std::min(size, bytes.size()));
  }
}

// Input: number of maps and of layers (1 byte each), width and height of the finest layer (1 byte each), coded cells.
void RunMap(std::string_view bytes) {
  std::vector<std::vector<MapLayer>> maps(1 + TakeNumber(1, bytes) % 8);
  const std::size_t layer_count = TakeNumber(1, bytes) % 9;
  const auto width = static_cast<std::int32_t>(TakeNumber(1, bytes));
  const auto height = static_cast<std::int32_t>(TakeNumber(1, bytes));
  std::vector<std::vector<MapLayer>*> pointers;
  for (std::vector<MapLayer>& map : maps) {
    for (std::size_t i = 0; i < layer_count; ++i) {
      MapLayer& layer = map.emplace_back();
      layer.grid.width = width;
      layer.grid.height = height;
      layer.resolution_um = 50'000u << i;
    }
    pointers.push_back(&map);
  }
  MapRunDecoder decoder;
  if (!decoder.Decode(bytes, pointers)) return;
  MapRunEncoder encoder(MapRunEncoder::Previous::kNever);
  for (const std::vector<MapLayer>& map : maps) encoder.Add(map);
  std::vector<std::vector<MapLayer>> again = maps;
  for (std::size_t i = 0; i < again.size(); ++i) pointers[i] = &again[i];
  MapRunDecoder other;
  Check(other.Decode(encoder.Finish(), pointers).has_value(), "maps decode when coded again");
  for (std::size_t i = 0; i < maps.size(); ++i) {
    for (std::size_t j = 0; j < maps[i].size(); ++j) {
      Check(maps[i][j].grid.cells == again[i][j].grid.cells, "a map comes back when coded again");
    }
  }
}

void RunRows(std::string_view bytes) {
  constexpr std::size_t kContentBytesMax = 1 << 20;
  ByteReader reader(bytes);
  const std::vector<std::string> rows = TakeRows(kContentBytesMax, reader);
  if (!reader.is_good()) return;
  std::string coded;
  PutRows({rows.begin(), rows.end()}, coded);
  ByteReader again(coded);
  Check(TakeRows(kContentBytesMax, again) == rows && again.is_good(), "rows come back when coded again");
}

// Input: codec (1 byte: even for plain, odd for a zstd frame), record count (2 bytes), coded bytes.
void RunPlain(std::string_view bytes) {
  const proto::Codec codec = TakeNumber(1, bytes) % 2 == 0 ? proto::CODEC_PLAIN : proto::CODEC_ZSTD;
  const auto count = static_cast<std::uint32_t>(TakeNumber(2, bytes));
  (void)DecodeBatch(codec, bytes, count);
}

// Input: the head of a batch, or the record of a map.
void RunReference(std::string_view bytes) {
  (void)ReferenceOf(bytes);
  const auto layers = LayersOfFrame(bytes);
  if (layers && CellCountOf(*layers) < 100'000) {
    std::vector<MapLayer> unknown = *layers;
    for (MapLayer& layer : unknown) layer.grid = Grid(layer.grid.width, layer.grid.height);
    (void)JoinMap(bytes, unknown);
  }
  const auto split = SplitMapRecord(bytes);
  if (!split) return;
  const auto joined = JoinMap(split->frame, split->layers);
  Check(joined && *joined == bytes, "a map that was taken apart can be joined");
}

// Input: data type (2 bytes), then the SQL statement of a record with kFuzzedSqlKey.
void RunSql(std::string_view bytes) {
  RecordKey key = kFuzzedSqlKey;
  key.stream.type = static_cast<DataType>(TakeNumber(2, bytes));
  const auto record = RecordOf(bytes, key);
  if (!record) return;
  Check(FromProto(record->key()) == key, "a statement makes the announced record");
  const std::optional<std::string> sql = SqlOf(*record);
  if (!sql) return;
  const auto again = RecordOf(*sql, key);
  Check(again && again->content() == record->content(), "a record comes back when stated again");
}

}  // namespace

std::size_t TakeNumber(std::size_t byte_count, std::string_view& bytes) {
  std::size_t number = 0;
  for (; byte_count > 0 && !bytes.empty(); --byte_count, bytes.remove_prefix(1)) {
    number = number << 8 | static_cast<unsigned char>(bytes.front());
  }
  return number;
}

const std::vector<FuzzedDecoder>& FuzzedDecoders() {
  static const std::vector<FuzzedDecoder> decoders = {{"batch", RunBatch},
                                                      {"run", RunRun},
                                                      {"map", RunMap},
                                                      {"rows", RunRows},
                                                      {"plain", RunPlain},
                                                      {"reference", RunReference},
                                                      {"sql", RunSql},
                                                      {"peer_frame", RunPeerFrame},
                                                      {"client_frame", RunClientFrame},
                                                      {"signed", RunSigned},
                                                      {"chain", RunChain}};
  return decoders;
}

}  // namespace moondb
