#include "bench/wire_measure.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>

#include "actors/sharing/coding/batch_codec.h"
#include "actors/sharing/coding/zstd_frame.h"
#include "actors/storage/paper_sql.h"
#include "bench/rolling_maps.h"
#include "model/check.h"
#include "proto/message.pb.h"
#include "proto/types.pb.h"

namespace moondb {

namespace {

using Previous = MapRunEncoder::Previous;
using Layers = std::vector<MapLayer>;

constexpr std::size_t kMessageBytesMax = 4 * 1024;  // Maximum size of the coded records in a message.
constexpr std::size_t kRowsPerBatchMax = 1024;
// Overhead per frame: the length field of ZMTP (9 bytes) and the encryption by CURVE (42 bytes).
constexpr std::size_t kFrameBytes = 9 + 42;
constexpr double kBytesPerSecond = 125'000;  // Capacity of a 1 Mbit/s link.

double ProcessorMs() { return 1e3 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

proto::Message Envelope(const RecordKey& first) {
  proto::Message message;
  message.set_agent_id(first.stream.origin);
  message.set_destination_id(1);
  message.set_remaining(1000);
  message.set_data_type(first.stream.type);
  message.set_record_id(ToString(first));
  message.set_source_actor("sync");
  message.set_destination_actor("sharing");
  message.set_hop_sender(first.stream.origin);
  return message;
}

std::size_t SentBytes(const proto::Message& message) { return message.ByteSizeLong() + kFrameBytes; }

std::size_t AcknowledgmentBytes(const RecordKey& last) {
  proto::Message message = Envelope(last);
  proto::Have& have = *message.mutable_have();
  have.set_session_id(0xFEDCBA9876543210u);
  have.set_batch_number(1000);
  have.set_unacked_bytes_max(8192);
  proto::StreamHave& stream = *have.mutable_have()->add_streams();
  stream.set_origin_agent(last.stream.origin);
  stream.set_epoch(last.stream.epoch);
  stream.set_data_type(last.stream.type);
  proto::Interval& held = *stream.add_held();
  held.set_first(1);
  held.set_last(last.seq);
  return SentBytes(message);
}

// Returns the size of a message with the coded rows plus the size of its acknowledgment.
std::size_t BatchBytes(const CodedRows& coded, const proto::RecordBatch& batch) {
  proto::Message message = Envelope(FromProto(batch.records(0).key()));
  proto::Batch& body = *message.mutable_batch();
  body.set_session_id(0xFEDCBA9876543210u);
  body.set_batch_number(1000);
  body.set_codec(proto::CODEC_COMPACT);
  body.set_coded(coded.bytes);
  if (coded.has_cells) body.set_run(1);
  body.set_record_count(static_cast<std::uint32_t>(batch.records_size()));
  return SentBytes(message) + AcknowledgmentBytes(FromProto(batch.records(batch.records_size() - 1).key()));
}

// Codes streams in batches that just fit into a message, and returns the number of bytes sent.
class Sender {
 public:
  explicit Sender(Previous previous) : encoder_(previous) {}

  std::size_t Send(const WireStream& stream) {
    std::size_t bytes = 0;
    for (std::size_t next = 0; next < stream.records.size();) bytes += SendSome(stream, next);
    return bytes;
  }

  double encode_ms() const { return encode_ms_; }
  double decode_ms() const { return decode_ms_; }

 private:
  std::size_t SendSome(const WireStream& stream, std::size_t& next) {
    const proto::RecordBatch some = SomeOf(stream, next);
    const double start_ms = ProcessorMs();
    const CodedRows coded = encoder_.EncodeSome(some, kMessageBytesMax);
    encode_ms_ += ProcessorMs() - start_ms;
    proto::RecordBatch batch;
    for (std::size_t i = 0; i < coded.record_count; ++i) *batch.add_records() = stream.records[next + i];
    next += coded.record_count;
    CheckDecodes(coded.bytes, batch);
    return BatchBytes(coded, batch);
  }

  // Returns the records from index `first` on, at most as many as a session requests from its storage at once.
  static proto::RecordBatch SomeOf(const WireStream& stream, std::size_t first) {
    constexpr std::size_t kContentBytesMax = 72 * 1024;
    proto::RecordBatch some;
    std::size_t content_bytes = 0;
    const std::size_t end = std::min(stream.records.size(), first + kRowsPerBatchMax);
    for (std::size_t i = first; i < end && content_bytes < kContentBytesMax; ++i) {
      content_bytes += stream.records[i].content().size();
      *some.add_records() = stream.records[i];
    }
    return some;
  }

  void CheckDecodes(const std::string& coded, const proto::RecordBatch& batch) {
    const double start_ms = ProcessorMs();
    const auto decoded = decoder_.Decode(coded, static_cast<std::uint32_t>(batch.records_size()));
    decode_ms_ += ProcessorMs() - start_ms;
    Check(decoded && decoded->SerializeAsString() == batch.SerializeAsString(), "a batch comes back as it was");
  }

  BatchEncoder encoder_;
  BatchDecoder decoder_;
  double encode_ms_ = 0, decode_ms_ = 0;
};

struct Cost {
  std::size_t bytes = 0;
  double encode_ms = 0, decode_ms = 0;  // Processor time, summed over all records.
};

Cost MissionCost(const WireMission& mission, Previous previous) {
  Sender sender(previous);
  Cost cost;
  for (const WireStream& stream : mission.streams) cost.bytes += sender.Send(stream);
  cost.encode_ms = sender.encode_ms();
  cost.decode_ms = sender.decode_ms();
  return cost;
}

std::size_t PackedBytes(const TraversabilityMap& map) {
  std::string cells;
  for (const MapLayer& layer : map.layers) cells += PackCells(layer.grid);
  const auto frame = CompressFrame(cells, FrameChecksum::kNone);
  Check(frame.has_value(), "zstd has memory");
  return frame->size();
}

struct Times {
  double encode_ms = 0;
  double decode_ms = 0;
};

// Codes the maps in runs of kRunMapsMax, and adds the processor time to `times`. Returns the number of coded bytes.
std::size_t RunBytes(const std::vector<TraversabilityMap>& maps, Previous previous, Times& times) {
  std::size_t bytes = 0;
  for (std::size_t first = 0; first < maps.size(); first += kRunMapsMax) {
    const std::size_t end = std::min(first + kRunMapsMax, maps.size());
    const double start_ms = ProcessorMs();
    MapRunEncoder encoder(previous);
    for (std::size_t i = first; i < end; ++i) encoder.Add(maps[i].layers);
    const std::string coded = encoder.Finish();
    times.encode_ms += ProcessorMs() - start_ms;
    bytes += coded.size();
    std::vector<Layers> decoded;
    std::vector<Layers*> pointers;
    for (std::size_t i = first; i < end; ++i) decoded.push_back(maps[i].layers);
    for (Layers& layers : decoded) {
      for (MapLayer& layer : layers) layer.grid.cells.clear();
      pointers.push_back(&layers);
    }
    const double decode_start_ms = ProcessorMs();
    MapRunDecoder decoder;
    Check(decoder.Decode(coded, pointers).has_value(), "maps decode");
    times.decode_ms += ProcessorMs() - decode_start_ms;
  }
  return bytes;
}

// Codes and decodes one stream's records in batches, and adds the processor time to `times`.
void CodeRows(const WireStream& stream, Times& times) {
  for (std::size_t next = 0; next < stream.records.size();) {
    proto::RecordBatch batch;
    const std::size_t end = std::min(stream.records.size(), next + kRowsPerBatchMax);
    for (; next < end; ++next) *batch.add_records() = stream.records[next];
    const double start_ms = ProcessorMs();
    const std::string coded = BatchEncoder(Previous::kNever).Encode(batch);
    times.encode_ms += ProcessorMs() - start_ms;
    const double decode_start_ms = ProcessorMs();
    const auto decoded = BatchDecoder().Decode(coded, static_cast<std::uint32_t>(batch.records_size()));
    times.decode_ms += ProcessorMs() - decode_start_ms;
    Check(decoded && decoded->records_size() == batch.records_size(), "rows decode");
  }
}

void MeasureMaps(const WireMission& mission, WireSizes& sizes) {
  Times alone, previous;
  for (const std::vector<TraversabilityMap>& maps : mission.rover_maps) {
    for (const TraversabilityMap& map : maps) {
      sizes.map_2bit_zstd_bytes += PackedBytes(map);
      MapRunEncoder encoder(Previous::kNever);
      encoder.Add(map.layers);
      sizes.map_single_bytes += encoder.Finish().size();
    }
    sizes.map_count += maps.size();
    sizes.map_batch_bytes += RunBytes(maps, Previous::kNever, alone);
    sizes.map_previous_bytes += RunBytes(maps, Previous::kWhereItPays, previous);
  }
  const double count = static_cast<double>(std::max<std::size_t>(sizes.map_count, 1));
  sizes.encode_ms = alone.encode_ms / count;
  sizes.decode_ms = alone.decode_ms / count;
  sizes.encode_previous_ms = previous.encode_ms / count;
  sizes.decode_previous_ms = previous.decode_ms / count;
}

std::string LineOf(const char* name, std::size_t bytes, std::size_t all) {
  return fmt::format("  {:<22}{:>12}   1/{:<6.1f}{:>8.1f} s at 1 Mbps\n", name, bytes,
                     static_cast<double>(all) / static_cast<double>(bytes),
                     static_cast<double>(bytes) / kBytesPerSecond);
}

std::string ShareOf(const char* name, std::size_t bytes, const WireSizes& sizes) {
  return fmt::format("  {:<22}{:>12}   {:.3f} of 2 bits a cell with zstd, {:.0f} bytes a map\n", name, bytes,
                     static_cast<double>(bytes) / static_cast<double>(sizes.map_2bit_zstd_bytes),
                     static_cast<double>(bytes) / static_cast<double>(sizes.map_count));
}

}  // namespace

std::size_t RecordCount(const WireMission& mission) {
  std::size_t count = 0;
  for (const WireStream& stream : mission.streams) count += stream.records.size();
  return count;
}

std::size_t PaperSqlBytes(const WireMission& mission) {
  std::size_t bytes = 0;
  for (const WireStream& stream : mission.streams) {
    for (const proto::StoredRecord& record : stream.records) {
      const RecordKey key = FromProto(record.key());
      proto::Message message = Envelope(key);
      const std::optional<std::string> sql = SqlOf(record);
      Check(sql.has_value(), "a mission's records have their statement");
      message.set_sql(*sql);
      bytes += SentBytes(message) + SentBytes(Envelope(key));
    }
  }
  return bytes;
}

WireSizes MeasureMission(const WireMission& mission) {
  WireSizes sizes;
  sizes.name = mission.name;
  sizes.record_count = RecordCount(mission);
  sizes.paper_sql_bytes = PaperSqlBytes(mission);
  sizes.alone_bytes = MissionCost(mission, Previous::kNever).bytes;
  sizes.previous_bytes = MissionCost(mission, Previous::kWhereItPays).bytes;
  MeasureMaps(mission, sizes);
  const Cost sent = MissionCost(mission, Previous::kWhileItPays);
  const double map_count = static_cast<double>(std::max<std::size_t>(sizes.map_count, 1));
  sizes.sent_bytes = sent.bytes;
  sizes.sent_encode_ms = sent.encode_ms / map_count;
  sizes.sent_decode_ms = sent.decode_ms / map_count;
  return sizes;
}

CodingTimes MeasureTimes(const WireMission& mission) {
  constexpr int kRowRepeats = 20;
  CodingTimes times;
  RollingOptions options;
  options.map_count = 3 * static_cast<int>(kRunMapsMax);
  options.cells_per_side = 100;
  const std::vector<TraversabilityMap> maps = MakeRollingMaps(options);
  Times alone, previous;
  RunBytes(maps, Previous::kNever, alone);
  RunBytes(maps, Previous::kWhereItPays, previous);
  times.map_encode_ms = alone.encode_ms / options.map_count;
  times.map_decode_ms = alone.decode_ms / options.map_count;
  times.map_encode_previous_ms = previous.encode_ms / options.map_count;
  times.map_decode_previous_ms = previous.decode_ms / options.map_count;
  Times rows;
  double row_count = 0;
  for (const WireStream& stream : mission.streams) {
    if (stream.data_type == proto::LOCAL_TRAVERSABILITY_MAP) continue;
    for (int i = 0; i < kRowRepeats; ++i) CodeRows(stream, rows);
    row_count += static_cast<double>(kRowRepeats * stream.records.size());
  }
  times.encoded_rows_per_s = row_count / rows.encode_ms * 1000;
  times.decoded_rows_per_s = row_count / rows.decode_ms * 1000;
  return times;
}

std::string TableOf(const std::vector<WireSizes>& all, const CodingTimes& times) {
  std::string text;
  for (const WireSizes& sizes : all) {
    text += fmt::format("{}: {} records, {} of them maps\n", sizes.name, sizes.record_count, sizes.map_count);
    text += LineOf("paper_sql", sizes.paper_sql_bytes, sizes.paper_sql_bytes);
    text += LineOf("alone", sizes.alone_bytes, sizes.paper_sql_bytes);
    text += LineOf("previous", sizes.previous_bytes, sizes.paper_sql_bytes);
    text += LineOf("as sessions send it", sizes.sent_bytes, sizes.paper_sql_bytes);
    text += ShareOf("map_2bit_zstd", sizes.map_2bit_zstd_bytes, sizes);
    text += ShareOf("map_single", sizes.map_single_bytes, sizes);
    text += ShareOf("map_batch", sizes.map_batch_bytes, sizes);
    text += ShareOf("map_previous", sizes.map_previous_bytes, sizes);
    text += fmt::format("  ms a map: {:.2f} to encode, {:.2f} to decode; with the previous map {:.2f} and {:.2f}\n",
                        sizes.encode_ms, sizes.decode_ms, sizes.encode_previous_ms, sizes.decode_previous_ms);
    text += fmt::format("  as sessions send it, ms a map, rows and all: {:.2f} to encode, {:.2f} to decode\n",
                        sizes.sent_encode_ms, sizes.sent_decode_ms);
  }
  text += fmt::format(
      "a map of 4 x 100 x 100 that rolls: {:.2f} ms to encode, {:.2f} to decode; with the previous map {:.2f} and "
      "{:.2f}\n",
      times.map_encode_ms, times.map_decode_ms, times.map_encode_previous_ms, times.map_decode_previous_ms);
  text += fmt::format("rows: {:.2f} million a second encoded, {:.2f} decoded\n", times.encoded_rows_per_s / 1e6,
                      times.decoded_rows_per_s / 1e6);
  return text;
}

std::string JsonOf(const std::vector<WireSizes>& all, const CodingTimes& times) {
  std::vector<std::string> missions;
  for (const WireSizes& sizes : all) {
    missions.push_back(fmt::format(
        "{{\"name\": \"{}\", \"records\": {}, \"maps\": {}, \"paper_sql_bytes\": {}, \"alone_bytes\": {}, "
        "\"previous_bytes\": {}, \"sent_bytes\": {}, \"map_2bit_zstd_bytes\": {}, \"map_single_bytes\": {}, "
        "\"map_batch_bytes\": {}, "
        "\"map_previous_bytes\": {}, \"encode_ms\": {:.3f}, \"decode_ms\": {:.3f}, \"encode_previous_ms\": {:.3f}, "
        "\"decode_previous_ms\": {:.3f}, \"sent_encode_ms\": {:.3f}, \"sent_decode_ms\": {:.3f}}}",
        sizes.name, sizes.record_count, sizes.map_count, sizes.paper_sql_bytes, sizes.alone_bytes, sizes.previous_bytes,
        sizes.sent_bytes, sizes.map_2bit_zstd_bytes, sizes.map_single_bytes, sizes.map_batch_bytes,
        sizes.map_previous_bytes, sizes.encode_ms, sizes.decode_ms, sizes.encode_previous_ms, sizes.decode_previous_ms,
        sizes.sent_encode_ms, sizes.sent_decode_ms));
  }
  const std::string coding = fmt::format(
      "{{\"map_encode_ms\": {:.3f}, \"map_decode_ms\": {:.3f}, \"map_encode_previous_ms\": {:.3f}, "
      "\"map_decode_previous_ms\": {:.3f}, \"encoded_rows_per_s\": {:.0f}, \"decoded_rows_per_s\": {:.0f}}}",
      times.map_encode_ms, times.map_decode_ms, times.map_encode_previous_ms, times.map_decode_previous_ms,
      times.encoded_rows_per_s, times.decoded_rows_per_s);
  return fmt::format("{{\"missions\": [\n  {}],\n \"times\": {}}}\n", fmt::join(missions, ",\n  "), coding);
}

}  // namespace moondb
