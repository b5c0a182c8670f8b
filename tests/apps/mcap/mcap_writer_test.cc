// Reads MCAP files back by their specification: https://mcap.dev/spec.
#include "apps/mcap/mcap_writer.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <zlib.h>
#include <zstd.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <random>

#include "tests/temporary_folder.h"

namespace moondb {
namespace {

constexpr std::size_t kMagicBytes = 8;

struct McapRecord {
  std::uint8_t opcode = 0;
  std::uint64_t offset = 0;
  std::string_view content;
};

template <typename Number>
Number NumberAt(std::string_view bytes, std::size_t at) {
  Number number{};
  EXPECT_LE(at + sizeof number, bytes.size());
  if (at + sizeof number <= bytes.size()) std::memcpy(&number, bytes.data() + at, sizeof number);
  return number;
}

std::uint32_t CrcOf(std::string_view bytes) {
  return static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

// Returns the whole records in `bytes` from `at` on.
std::vector<McapRecord> RecordsOf(std::string_view bytes, std::size_t at) {
  std::vector<McapRecord> records;
  while (at + 9 <= bytes.size()) {
    const auto size = NumberAt<std::uint64_t>(bytes, at + 1);
    if (size > bytes.size() - at - 9) break;
    records.push_back({static_cast<std::uint8_t>(bytes[at]), at, bytes.substr(at + 9, size)});
    at += 9 + size;
  }
  return records;
}

// Returns the records of a chunk. Checks the chunk's CRC.
std::string ChunkRecords(std::string_view chunk) {
  const auto size = NumberAt<std::uint64_t>(chunk, 16);
  const auto crc = NumberAt<std::uint32_t>(chunk, 24);
  EXPECT_EQ(chunk.substr(32, 4), "zstd");
  const auto compressed = NumberAt<std::uint64_t>(chunk, 36);
  std::string records(size, '\0');
  EXPECT_EQ(ZSTD_decompress(records.data(), size, chunk.data() + 44, compressed), size);
  EXPECT_EQ(CrcOf(records), crc);
  return records;
}

// Returns the number of messages in the whole chunks of a file that may have been cut.
std::size_t CountMessages(std::string_view bytes) {
  std::size_t count = 0;
  for (const McapRecord& record : RecordsOf(bytes, kMagicBytes)) {
    if (record.opcode != 0x06) continue;
    const std::string records = ChunkRecords(record.content);
    for (const McapRecord& inner : RecordsOf(records, 0)) count += inner.opcode == 0x05 ? 1 : 0;
  }
  return count;
}

std::string ReadBytes(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

class McapWriterTest : public testing::Test {
 protected:
  // Writes messages of 100 kB that cannot be compressed: several chunks. Returns the first error.
  Result<void> WriteMessages(int count, bool is_closed = true) {
    Result<McapWriter> writer = McapWriter::Open(file_, "ros2");
    if (!writer) return tl::unexpected(writer.error());
    const std::uint16_t schema = writer->AddSchema("std_msgs/msg/String", "ros2msg", "string data");
    const std::uint16_t even = writer->AddChannel(schema, "/even", "cdr", {{"a", "b"}});
    const std::uint16_t odd = writer->AddChannel(schema, "/odd", "cdr", {});
    std::mt19937 random(1);
    for (int i = 0; i < count; ++i) {
      std::string message(100'000, '\0');
      for (char& byte : message) byte = static_cast<char>(random());
      const auto done = writer->Write(i % 2 == 0 ? even : odd, 1000 + static_cast<std::uint64_t>(i), message);
      if (!done) return done;
    }
    return is_closed ? writer->Close("notes", {{"team", "moon"}}) : Result<void>();
  }

  const TemporaryFolder folder_;
  const std::string file_ = folder_.File("a.mcap");
};

TEST_F(McapWriterTest, ItsIndexesCountsAndChecksumsAreRight) {
  ASSERT_TRUE(WriteMessages(25));
  const std::string bytes = ReadBytes(file_);
  EXPECT_EQ(bytes.substr(0, kMagicBytes), std::string("\x89MCAP0\r\n", 8));
  EXPECT_EQ(bytes.substr(bytes.size() - kMagicBytes), std::string("\x89MCAP0\r\n", 8));
  EXPECT_EQ(CountMessages(bytes), 25u);
  std::size_t chunks = 0;
  for (const McapRecord& record : RecordsOf(bytes, kMagicBytes)) {
    if (record.opcode == 0x08) {  // Chunk index.
      ++chunks;
      const auto offset = NumberAt<std::uint64_t>(record.content, 16);
      EXPECT_EQ(bytes[offset], 0x06);
      const std::string records = ChunkRecords(std::string_view(bytes).substr(offset + 9));
      const auto map_bytes = NumberAt<std::uint32_t>(record.content, 32);
      for (std::size_t at = 36; at < 36 + map_bytes; at += 10) {
        const auto channel = NumberAt<std::uint16_t>(record.content, at);
        const auto index = NumberAt<std::uint64_t>(record.content, at + 2);
        ASSERT_EQ(bytes[index], 0x07);  // Message index.
        EXPECT_EQ(NumberAt<std::uint16_t>(bytes, index + 9), channel);
        const auto entry_bytes = NumberAt<std::uint32_t>(bytes, index + 11);
        for (std::size_t entry = index + 15; entry < index + 15 + entry_bytes; entry += 16) {
          const auto time = NumberAt<std::uint64_t>(bytes, entry);
          const auto at_record = NumberAt<std::uint64_t>(bytes, entry + 8);
          EXPECT_EQ(records[at_record], 0x05);
          EXPECT_EQ(NumberAt<std::uint16_t>(records, at_record + 9), channel);
          EXPECT_EQ(NumberAt<std::uint64_t>(records, at_record + 15), time);
        }
      }
    }
    if (record.opcode == 0x0B) {  // Statistics.
      EXPECT_EQ(NumberAt<std::uint64_t>(record.content, 0), 25u);
      EXPECT_EQ(NumberAt<std::uint64_t>(record.content, 26), 1000u);
      EXPECT_EQ(NumberAt<std::uint64_t>(record.content, 34), 1024u);
    }
    if (record.opcode == 0x0F) {  // End of the data.
      EXPECT_EQ(NumberAt<std::uint32_t>(record.content, 0), CrcOf(std::string_view(bytes).substr(0, record.offset)));
    }
    if (record.opcode == 0x02) {  // Footer.
      const auto summary = NumberAt<std::uint64_t>(record.content, 0);
      EXPECT_EQ(bytes[summary], 0x03);
      const std::string_view covered = std::string_view(bytes).substr(summary, record.offset + 9 + 16 - summary);
      EXPECT_EQ(NumberAt<std::uint32_t>(record.content, 16), CrcOf(covered));
    }
    if (record.opcode == 0x0E) {  // Summary offset.
      EXPECT_EQ(static_cast<std::uint8_t>(bytes[NumberAt<std::uint64_t>(record.content, 1)]),
                static_cast<std::uint8_t>(record.content[0]));
    }
  }
  EXPECT_EQ(chunks, 3u);
}

TEST_F(McapWriterTest, AFileThatWasCutIsReadableUpToItsLastWholeChunk) {
  ASSERT_TRUE(WriteMessages(25));
  const std::string bytes = ReadBytes(file_);
  EXPECT_EQ(CountMessages(std::string_view(bytes).substr(0, bytes.size() * 6 / 10)), 11u);
  EXPECT_EQ(CountMessages(std::string_view(bytes).substr(0, 100)), 0u);
}

TEST_F(McapWriterTest, AMissingEndLosesTheLastChunkAlone) {
  ASSERT_TRUE(WriteMessages(25, /*is_closed=*/false));
  EXPECT_EQ(CountMessages(ReadBytes(file_)), 22u);
}

TEST_F(McapWriterTest, AFullDiskIsAnErrorAndWhatWasWrittenIsReadable) {
  const auto before = ::signal(SIGXFSZ, SIG_IGN);
  rlimit limit{};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &limit), 0);
  const rlimit small{1'500'000, limit.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const Result<void> written = WriteMessages(25);
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &limit), 0);
  (void)::signal(SIGXFSZ, before);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().field, file_);
  EXPECT_EQ(CountMessages(ReadBytes(file_)), 11u);
}

TEST_F(McapWriterTest, AFolderThatIsMissingIsAnError) {
  const auto writer = McapWriter::Open(folder_.File("missing") + "/a.mcap", "ros2");
  ASSERT_FALSE(writer);
  EXPECT_NE(writer.error().text.find("No such file"), std::string::npos) << writer.error().text;
}

TEST_F(McapWriterTest, AnEmptyRecordingIsAValidFile) {
  ASSERT_TRUE(WriteMessages(0));
  EXPECT_EQ(CountMessages(ReadBytes(file_)), 0u);
}

}  // namespace
}  // namespace moondb
