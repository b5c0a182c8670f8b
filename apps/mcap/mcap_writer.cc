#include "apps/mcap/mcap_writer.h"

#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "apps/mcap/little_endian.h"
#include "model/check.h"

namespace moondb {
namespace {

constexpr char kMagic[] = "\x89MCAP0\r\n";
constexpr std::size_t kMagicBytes = 8;
constexpr std::size_t kChunkBytes = 1 << 20;
constexpr int kCompressionLevel = 7;

// Opcodes of records.
enum Opcode : std::uint8_t {
  kHeader = 0x01,
  kFooter = 0x02,
  kSchema = 0x03,
  kChannel = 0x04,
  kMessage = 0x05,
  kChunk = 0x06,
  kMessageIndex = 0x07,
  kChunkIndex = 0x08,
  kStatistics = 0x0B,
  kMetadata = 0x0C,
  kMetadataIndex = 0x0D,
  kSummaryOffset = 0x0E,
  kDataEnd = 0x0F,
};

// The content of a record.
class Fields {
 public:
  template <typename Number>
  Fields& Add(Number value) {
    AppendLittleEndian(value, bytes_);
    return *this;
  }
  Fields& AddText(std::string_view text) {
    Add(static_cast<std::uint32_t>(text.size()));
    return AddBytes(text);
  }
  Fields& AddMap(const McapWriter::Metadata& map) {
    Fields pairs;
    for (const auto& [key, value] : map) pairs.AddText(key).AddText(value);
    return AddText(pairs.bytes_);
  }
  Fields& AddBytes(std::string_view bytes) {
    bytes_.append(bytes);
    return *this;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

std::string RecordOf(Opcode opcode, const Fields& fields) {
  std::string record(1, static_cast<char>(opcode));
  AppendLittleEndian(static_cast<std::uint64_t>(fields.bytes().size()), record);
  return record + fields.bytes();
}

std::uint32_t CrcOf(std::string_view bytes, std::uint32_t crc = 0) {
  return static_cast<std::uint32_t>(crc32_z(crc, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

// Returns the error of the last call that set errno.
Error CannotWrite(const std::filesystem::path& path) {
  const std::string reason = std::generic_category().message(errno == 0 ? EIO : errno);
  return {ErrorCode::kInternal, "cannot write the file: " + reason, path.string()};
}

std::string Compressed(const std::string& bytes) {
  std::string compressed(ZSTD_compressBound(bytes.size()), '\0');
  const std::size_t size =
      ZSTD_compress(compressed.data(), compressed.size(), bytes.data(), bytes.size(), kCompressionLevel);
  Check(ZSTD_isError(size) == 0, "zstd compresses into a buffer of its own bound");
  compressed.resize(size);
  return compressed;
}

}  // namespace

Result<McapWriter> McapWriter::Open(const std::filesystem::path& file, const std::string& profile) {
  errno = 0;
  std::ofstream stream(file, std::ios::binary | std::ios::trunc);
  if (!stream) return tl::unexpected(CannotWrite(file));
  McapWriter writer(file, std::move(stream));
  const std::string header = RecordOf(kHeader, Fields().AddText(profile).AddText("moondb"));
  if (auto done = writer.Append(std::string(kMagic, kMagicBytes) + header); !done) return tl::unexpected(done.error());
  return writer;
}

Result<void> McapWriter::Append(std::string_view bytes) {
  errno = 0;
  file_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file_.flush();
  if (!file_) return tl::unexpected(CannotWrite(path_));
  size_ += bytes.size();
  crc_ = CrcOf(bytes, crc_);
  return {};
}

std::uint16_t McapWriter::AddSchema(std::string_view name, std::string_view encoding, std::string_view definition) {
  const std::uint16_t id = ++schema_count_;  // 0 means "no schema".
  const std::string record = RecordOf(kSchema, Fields().Add(id).AddText(name).AddText(encoding).AddText(definition));
  chunk_.records += record;
  schemas_ += record;
  return id;
}

std::uint16_t McapWriter::AddChannel(std::uint16_t schema, std::string_view topic, std::string_view encoding,
                                     const Metadata& metadata) {
  Check(schema > 0 && schema <= schema_count_, "a schema of this file");
  const std::uint16_t id = channel_count_++;
  const std::string record =
      RecordOf(kChannel, Fields().Add(id).Add(schema).AddText(topic).AddText(encoding).AddMap(metadata));
  chunk_.records += record;
  channels_ += record;
  counts_.by_channel[id] = 0;
  return id;
}

Result<void> McapWriter::Write(std::uint16_t channel, std::uint64_t time_ns, std::string_view message) {
  Check(channel < channel_count_, "a channel of this file");
  const bool is_first_of_chunk = chunk_.messages.empty();
  chunk_.first_ns = is_first_of_chunk ? time_ns : std::min(chunk_.first_ns, time_ns);
  chunk_.last_ns = is_first_of_chunk ? time_ns : std::max(chunk_.last_ns, time_ns);
  counts_.first_ns = counts_.messages == 0 ? time_ns : std::min(counts_.first_ns, time_ns);
  counts_.last_ns = std::max(counts_.last_ns, time_ns);
  ++counts_.messages;
  const auto sequence = static_cast<std::uint32_t>(counts_.by_channel[channel]++);
  chunk_.messages[channel].push_back({time_ns, chunk_.records.size()});
  chunk_.records += RecordOf(kMessage, Fields().Add(channel).Add(sequence).Add(time_ns).Add(time_ns).AddBytes(message));
  return chunk_.records.size() < kChunkBytes ? Result<void>() : WriteChunk();
}

Result<void> McapWriter::WriteChunk() {
  if (chunk_.records.empty()) return {};
  const Chunk chunk = std::exchange(chunk_, {});
  const std::string compressed = Compressed(chunk.records);
  const std::uint64_t chunk_offset = size_;
  const std::string record = RecordOf(kChunk, Fields()
                                                  .Add(chunk.first_ns)
                                                  .Add(chunk.last_ns)
                                                  .Add(static_cast<std::uint64_t>(chunk.records.size()))
                                                  .Add(CrcOf(chunk.records))
                                                  .AddText("zstd")
                                                  .Add(static_cast<std::uint64_t>(compressed.size()))
                                                  .AddBytes(compressed));
  std::string indexes;
  Fields offsets;  // Channels and the offsets of their indexes.
  for (const auto& [channel, messages] : chunk.messages) {
    offsets.Add(channel).Add(chunk_offset + record.size() + indexes.size());
    Fields entries;
    for (const Indexed& message : messages) entries.Add(message.time_ns).Add(message.offset);
    indexes += RecordOf(kMessageIndex, Fields().Add(channel).AddText(entries.bytes()));
  }
  if (auto done = Append(record + indexes); !done) return done;
  chunk_indexes_ += RecordOf(kChunkIndex, Fields()
                                              .Add(chunk.first_ns)
                                              .Add(chunk.last_ns)
                                              .Add(chunk_offset)
                                              .Add(static_cast<std::uint64_t>(record.size()))
                                              .AddText(offsets.bytes())
                                              .Add(static_cast<std::uint64_t>(indexes.size()))
                                              .AddText("zstd")
                                              .Add(static_cast<std::uint64_t>(compressed.size()))
                                              .Add(static_cast<std::uint64_t>(chunk.records.size())));
  ++chunk_count_;
  return {};
}

Result<void> McapWriter::Close(std::string_view metadata_name, const Metadata& metadata) {
  if (auto done = WriteChunk(); !done) return done;
  const std::uint64_t offset = size_;
  const std::string record = RecordOf(kMetadata, Fields().AddText(metadata_name).AddMap(metadata));
  if (auto done = Append(record); !done) return done;
  if (auto done = Append(RecordOf(kDataEnd, Fields().Add(crc_))); !done) return done;
  const std::string index = RecordOf(
      kMetadataIndex, Fields().Add(offset).Add(static_cast<std::uint64_t>(record.size())).AddText(metadata_name));
  if (auto done = WriteSummary(index); !done) return done;
  errno = 0;
  file_.close();
  return file_ ? Result<void>() : tl::unexpected(CannotWrite(path_));
}

Result<void> McapWriter::WriteSummary(std::string_view metadata_index) {
  Fields by_channel;
  for (const auto& [channel, count] : counts_.by_channel) by_channel.Add(channel).Add(count);
  const std::string statistics = RecordOf(kStatistics, Fields()
                                                           .Add(counts_.messages)
                                                           .Add(schema_count_)
                                                           .Add(std::uint32_t{channel_count_})
                                                           .Add(std::uint32_t{0})  // Attachments.
                                                           .Add(std::uint32_t{1})  // Metadata records.
                                                           .Add(chunk_count_)
                                                           .Add(counts_.first_ns)
                                                           .Add(counts_.last_ns)
                                                           .AddText(by_channel.bytes()));
  const std::uint64_t summary_offset = size_;
  std::string summary;
  std::string offsets;
  const auto add = [&](Opcode opcode, std::string_view records) {
    if (records.empty()) return;
    offsets += RecordOf(kSummaryOffset, Fields()
                                            .Add(static_cast<std::uint8_t>(opcode))
                                            .Add(summary_offset + summary.size())
                                            .Add(static_cast<std::uint64_t>(records.size())));
    summary += records;
  };
  add(kSchema, schemas_);
  add(kChannel, channels_);
  add(kStatistics, statistics);
  add(kChunkIndex, chunk_indexes_);
  add(kMetadataIndex, metadata_index);
  const std::uint64_t offsets_offset = summary_offset + summary.size();
  summary += offsets;
  // The CRC covers the summary and the footer up to the CRC.
  const std::string footer = RecordOf(kFooter, Fields().Add(summary_offset).Add(offsets_offset).Add(std::uint32_t{0}));
  summary += footer.substr(0, footer.size() - sizeof(std::uint32_t));
  AppendLittleEndian(CrcOf(summary), summary);
  return Append(summary + std::string(kMagic, kMagicBytes));
}

}  // namespace moondb
