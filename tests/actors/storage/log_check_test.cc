#include "actors/storage/log_check.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <random>

#include "proto/types.pb.h"
#include "tests/actors/storage/store_fixtures.h"

namespace moondb {
namespace {

constexpr int kRecords = 20;
constexpr std::size_t kHeaderBytes = 32;
constexpr std::size_t kFrameBytes = 24 + 4096;

// Copies the file and the write-ahead log of a running store, as a killed process would leave them. The log has one
// transaction per record.
class LogCheckTest : public testing::Test {
 protected:
  LogCheckTest() {
    {
      const auto running = OpenStore(StoreOptionsOf(1, folder_.File("running")));
      // Closing the store moves the schema from the log into the file.
    }
    const auto running = OpenStore(StoreOptionsOf(1, folder_.File("running")));
    for (std::uint64_t i = 1; i <= kRecords; ++i) InsertOne(*running, NodeRecord(1, i));
    std::filesystem::copy_file(folder_.File("running"), path_);
    std::filesystem::copy_file(folder_.File("running-wal"), path_ + "-wal");
  }

  std::string Read() const {
    std::ifstream file(path_ + "-wal", std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  void Write(const std::string& log) const { std::ofstream(path_ + "-wal", std::ios::binary) << log; }

  // Opens the store. Returns its number of records, and sets `damage` to the damage that the store reports.
  std::size_t RecordsAfterAStart(std::vector<std::string>& damage) const {
    const auto store = OpenStore(StoreOptionsOf(1, path_));
    damage = store->damage();
    return Contents(*store).size();
  }

  const TemporaryFolder folder_;
  const std::string path_ = folder_.File("killed");
};

TEST_F(LogCheckTest, FindsNothingInALogThatIsWhole) {
  EXPECT_EQ(FindLogDamage(path_), "");
  EXPECT_EQ(FindLogDamage(folder_.File("nothing")), "");
  std::vector<std::string> damage;
  EXPECT_EQ(RecordsAfterAStart(damage), std::size_t{kRecords});
  EXPECT_TRUE(damage.empty());
}

TEST_F(LogCheckTest, FindsNothingInALogThatAPowerCutTruncatesAnywhere) {
  const std::string whole = Read();
  for (std::size_t bytes = 0; bytes < whole.size(); bytes += 1777) {
    Write(whole.substr(0, bytes));
    EXPECT_EQ(FindLogDamage(path_), "") << bytes;
  }
}

TEST_F(LogCheckTest, FindsNothingIfTheLastTransactionIsTorn) {
  std::string torn = Read();
  torn[torn.size() - 100] ^= 1;
  Write(torn);
  EXPECT_EQ(FindLogDamage(path_), "");
}

TEST_F(LogCheckTest, FindsNothingInFramesOfAnEarlierLog) {
  std::string log = Read();
  const std::size_t half = kHeaderBytes + (log.size() / kFrameBytes / 2) * kFrameBytes;
  // Changes the frame's salt. Frames of an earlier log have another salt.
  for (std::size_t at = half; at < log.size(); at += kFrameBytes) ++log[at + 8];
  Write(log);
  EXPECT_EQ(FindLogDamage(path_), "");
}

TEST_F(LogCheckTest, AStartReportsEachFlippedBitThatLosesRecords) {
  const std::uint32_t seed = std::random_device{}();
  std::mt19937 random(seed);
  const std::string whole = Read();
  const std::string database = [this] {
    std::ifstream file(path_, std::ios::binary);
    return std::string{std::istreambuf_iterator<char>(file), {}};
  }();
  int lost_count = 0;
  for (int i = 0; i < 60; ++i) {
    std::string flipped = whole;
    // The first round flips a bit of the header.
    std::size_t byte = i == 0 ? 17 : random() % whole.size();
    // Skips bytes 4 to 7 of a frame, which mark the end of a transaction. A flip in these bytes can make the store
    // report damage although at most the last record is lost.
    if (byte >= kHeaderBytes && (byte - kHeaderBytes) % kFrameBytes / 4 == 1) byte += 4;
    flipped[byte] = static_cast<char>(flipped[byte] ^ (1 << random() % 8));
    std::ofstream(path_, std::ios::binary) << database;
    Write(flipped);
    std::vector<std::string> damage;
    const std::size_t left = RecordsAfterAStart(damage);
    // Losing only the last record looks like a power cut during its write, so it is not damage.
    if (left < kRecords - 1) {
      ++lost_count;
      ASSERT_EQ(damage.size(), 1u) << "seed " << seed << ", byte " << byte << ", records " << left;
      EXPECT_NE(damage[0].find("write-ahead log is damaged"), std::string::npos) << damage[0];
    } else {
      EXPECT_TRUE(damage.empty()) << "seed " << seed << ", byte " << byte << ": " << damage[0];
    }
  }
  EXPECT_GT(lost_count, 30);
}

}  // namespace
}  // namespace moondb
