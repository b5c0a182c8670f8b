#include "actors/storage/log_check.h"

#include <array>
#include <cstdint>
#include <fstream>
#include <optional>
#include <span>
#include <vector>

namespace moondb {

namespace {

constexpr std::size_t kHeaderBytes = 32;
constexpr std::size_t kFrameHeaderBytes = 24;
// Magic number of the log's header. SQLite sets the lowest bit if the checksums use big-endian words.
constexpr std::uint32_t kMagic = 0x377f0682;
constexpr std::size_t kUsualPageBytes = 4096;

using Bytes = std::span<const unsigned char>;

std::uint32_t BigEndian(Bytes bytes, std::size_t at) {
  return std::uint32_t{bytes[at]} << 24 | std::uint32_t{bytes[at + 1]} << 16 | std::uint32_t{bytes[at + 2]} << 8 |
         bytes[at + 3];
}

std::uint32_t LittleEndian(Bytes bytes, std::size_t at) {
  return std::uint32_t{bytes[at + 3]} << 24 | std::uint32_t{bytes[at + 2]} << 16 | std::uint32_t{bytes[at + 1]} << 8 |
         bytes[at];
}

// The checksum that SQLite's log stores for its frames, over all bytes added so far.
class Checksum {
 public:
  explicit Checksum(bool is_big_endian) : read_(is_big_endian ? BigEndian : LittleEndian) {}

  // Requires: the number of bytes is a multiple of 8.
  void Add(Bytes bytes) {
    for (std::size_t at = 0; at + 8 <= bytes.size(); at += 8) {
      first_ += read_(bytes, at) + second_;
      second_ += read_(bytes, at + 4) + first_;
    }
  }
  bool IsWrittenAt(Bytes bytes, std::size_t at) const {
    return BigEndian(bytes, at) == first_ && BigEndian(bytes, at + 4) == second_;
  }

 private:
  std::uint32_t (*const read_)(Bytes, std::size_t);
  std::uint32_t first_ = 0;
  std::uint32_t second_ = 0;
};

bool IsPageSize(std::size_t bytes) { return bytes >= 512 && bytes <= 65536 && (bytes & (bytes - 1)) == 0; }

}  // namespace

std::string FindLogDamage(const std::string& database_path) {
  std::ifstream log(database_path + "-wal", std::ios::binary);
  std::array<unsigned char, kHeaderBytes> header{};
  if (!log.read(reinterpret_cast<char*>(header.data()), kHeaderBytes)) return "";
  Checksum checksum((BigEndian(header, 0) & 1) != 0);
  checksum.Add(Bytes(header).first(kFrameHeaderBytes));
  const bool is_header_good = (BigEndian(header, 0) & ~1u) == kMagic && checksum.IsWrittenAt(header, kFrameHeaderBytes);
  const std::size_t stated_bytes = BigEndian(header, 8);
  const std::size_t page_bytes = is_header_good && IsPageSize(stated_bytes) ? stated_bytes : kUsualPageBytes;

  std::vector<unsigned char> frame(kFrameHeaderBytes + page_bytes);
  const Bytes bytes(frame);
  std::uint64_t salts = std::uint64_t{BigEndian(header, 16)} << 32 | BigEndian(header, 20);
  std::optional<std::uint64_t> damaged_at;  // Offset of the first damaged frame.
  if (!is_header_good) damaged_at = 0;
  // True once the commit frame of the damaged frame's transaction was read.
  bool is_committed = false;
  for (std::uint64_t at = kHeaderBytes; log.read(reinterpret_cast<char*>(frame.data()), frame.size());
       at += frame.size()) {
    const std::uint64_t frame_salts = std::uint64_t{BigEndian(bytes, 8)} << 32 | BigEndian(bytes, 12);
    // If the header is damaged, its salts may be wrong. Use the salts of the first frame instead.
    if (!is_header_good && at == kHeaderBytes) salts = frame_salts;
    const bool is_of_this_log = frame_salts == salts;
    if (damaged_at && is_committed && is_of_this_log) {
      return "the write-ahead log is damaged at byte " + std::to_string(*damaged_at) +
             ": records stored after it are lost unless another agent has them";
    }
    if (!damaged_at) {
      checksum.Add(bytes.first(8));
      checksum.Add(bytes.subspan(kFrameHeaderBytes));
      if (!is_of_this_log || !checksum.IsWrittenAt(bytes, 16)) damaged_at = at;
    }
    const bool is_last_of_transaction = BigEndian(bytes, 4) != 0;
    if (damaged_at && is_last_of_transaction && (is_of_this_log || *damaged_at == at)) is_committed = true;
  }
  return "";
}

}  // namespace moondb
