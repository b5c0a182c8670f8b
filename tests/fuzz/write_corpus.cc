// write_corpus FOLDER: writes the corpus of tests/fuzz anew, from maps and records that are drawn.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

#include "actors/sharing/codec.h"
#include "actors/sharing/coding/row_codec.h"
#include "tests/actors/sharing/coding/records.h"

namespace moondb {
namespace {

std::string Number(std::size_t value, int byte_count) {
  std::string bytes;
  for (int i = byte_count - 1; i >= 0; --i) bytes.push_back(static_cast<char>(value >> (8 * i)));
  return bytes;
}

proto::RecordBatch Rows() {
  proto::RecordBatch batch = RowBatch(20);
  *batch.add_records() = Store("no record at all", 1234, 9);
  return batch;
}

proto::RecordBatch Mixed() {
  proto::RecordBatch batch = Rows();
  batch.MergeFrom(MapBatch(0, 2));
  return batch;
}

bool Write(const std::filesystem::path& folder, const std::string& decoder, const std::string& name,
           const std::string& bytes) {
  std::error_code error;
  std::filesystem::create_directories(folder / decoder, error);
  std::ofstream file(folder / decoder / name, std::ios::binary);
  file << bytes;
  return static_cast<bool>(file.flush());
}

std::string CodedRun() {
  BatchEncoder encoder(MapRunEncoder::Previous::kWherePlaced);
  std::string bytes;
  for (int first = 0; first < 4; first += 2) {
    const std::string coded = encoder.Encode(MapBatch(first, 2));
    bytes += Number(2, 1) + Number(coded.size(), 2) + coded;
  }
  return bytes;
}

std::string CodedMaps(MapRunEncoder::Previous previous) {
  MapRunEncoder encoder(previous);
  for (int i = 0; i < 2; ++i) encoder.Add(RoomMap(7, 0.2 * i, 0, 0.3 * i, /*layer_count=*/2, /*cells=*/48));
  return Number(1, 1) + Number(2, 1) + Number(48, 1) + Number(48, 1) + encoder.Finish();
}

std::string CodedRows(const proto::RecordBatch& batch) {
  std::vector<std::string_view> contents;
  for (const proto::StoredRecord& record : batch.records()) contents.push_back(record.content());
  std::string bytes;
  PutRows(contents, bytes);
  return bytes;
}

bool WriteAll(const std::filesystem::path& folder) {
  const auto counted = [](const proto::RecordBatch& batch) {
    return Number(static_cast<std::size_t>(batch.records_size()), 2);
  };
  const auto compact = [](const proto::RecordBatch& batch) {
    return BatchEncoder(MapRunEncoder::Previous::kWhereItPays).Encode(batch);
  };
  const proto::StoredRecord reference = MapBatch(0, 1).records(0);
  BatchEncoder with_reference(MapRunEncoder::Previous::kWherePlaced);
  with_reference.BeginRun(&reference);
  const proto::RecordBatch rows = RowBatch(5), maps = MapBatch(0, 2);
  return Write(folder, "batch", "rows", counted(rows) + compact(rows)) &&
         Write(folder, "batch", "maps", counted(maps) + compact(maps)) &&
         Write(folder, "batch", "mixed", counted(Mixed()) + compact(Mixed())) &&
         Write(folder, "run", "maps", CodedRun()) &&
         Write(folder, "map", "alone", CodedMaps(MapRunEncoder::Previous::kNever)) &&
         Write(folder, "map", "previous", CodedMaps(MapRunEncoder::Previous::kWherePlaced)) &&
         Write(folder, "rows", "one_type", CodedRows(rows)) && Write(folder, "rows", "mixed", CodedRows(Rows())) &&
         Write(folder, "plain", "plain", Number(0, 1) + counted(rows) + rows.SerializeAsString()) &&
         Write(folder, "plain", "frame", Number(1, 1) + counted(Mixed()) + EncodeBatch(Mixed()).bytes) &&
         Write(folder, "reference", "head", with_reference.Encode(MapBatch(1, 1))) &&
         Write(folder, "reference", "map", MapOf(RoomMap(7, 0, 0, 0, 1, 24), 0).content());
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: write_corpus FOLDER\n");
    return 2;
  }
  return moondb::WriteAll(argv[1]) ? 0 : 1;
}
