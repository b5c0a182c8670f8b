// McapWriter: writes an MCAP file (https://mcap.dev/spec) in chunks compressed by zstd, with message indexes, a summary
// and CRCs.
//
// Each chunk is written as soon as it is full, and channels precede their messages. A file that ends early, because the
// program was killed or the disk is full, can be read up to its last whole chunk. Not thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "model/error.h"

namespace moondb {

class McapWriter {
 public:
  using Metadata = std::map<std::string, std::string>;

  // Creates the file, or replaces it. Returns kInternal, with the path, if it cannot be written.
  static Result<McapWriter> Open(const std::filesystem::path& file, const std::string& profile);

  std::uint16_t AddSchema(std::string_view name, std::string_view encoding, std::string_view definition);
  std::uint16_t AddChannel(std::uint16_t schema, std::string_view topic, std::string_view encoding,
                           const Metadata& metadata);
  // Appends a message. Returns kInternal, with the path, if a chunk cannot be written. Times are ns since 1970 UTC.
  Result<void> Write(std::uint16_t channel, std::uint64_t time_ns, std::string_view message);
  // Writes the last chunk, `metadata` under the name `metadata_name`, and the summary. Errors are those of Write.
  Result<void> Close(std::string_view metadata_name, const Metadata& metadata);

  struct Counts {
    std::uint64_t messages = 0;
    std::uint64_t first_ns = 0;
    std::uint64_t last_ns = 0;
    std::map<std::uint16_t, std::uint64_t> by_channel;
  };
  const Counts& counts() const { return counts_; }

 private:
  // Place and time of a message in the chunk, or of a chunk in the file.
  struct Indexed {
    std::uint64_t time_ns;
    std::uint64_t offset;
  };
  struct Chunk {
    std::string records;
    std::uint64_t first_ns = 0;
    std::uint64_t last_ns = 0;
    std::map<std::uint16_t, std::vector<Indexed>> messages;
  };

  McapWriter(std::filesystem::path path, std::ofstream file) : path_(std::move(path)), file_(std::move(file)) {}

  Result<void> WriteChunk();
  Result<void> WriteSummary(std::string_view metadata_index);
  Result<void> Append(std::string_view bytes);

  std::filesystem::path path_;
  std::ofstream file_;
  std::uint64_t size_ = 0;  // Bytes of the file.
  std::uint32_t crc_ = 0;   // CRC-32 of these bytes.
  std::string schemas_;     // Records for the summary.
  std::string channels_;
  std::string chunk_indexes_;
  std::uint16_t schema_count_ = 0;
  std::uint16_t channel_count_ = 0;
  std::uint32_t chunk_count_ = 0;
  Chunk chunk_;
  Counts counts_;
};

}  // namespace moondb
