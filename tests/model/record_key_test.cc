#include "model/record_key.h"

#include <gtest/gtest.h>

#include "model/record_hash.h"
#include "proto/types.pb.h"

namespace moondb {
namespace {

const RecordKey kKey{StreamKey{2, 0x5f3c9a1e0b7d4c21, proto::LOCAL_TRAVERSABILITY_MAP}, 17};

TEST(RecordKeyTest, ReadsItsOwnText) {
  EXPECT_EQ(ToString(kKey), "2.5f3c9a1e0b7d4c21.30.17");
  const Result<RecordKey> read = ParseRecordKey("2.5f3c9a1e0b7d4c21.30.17");
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(*read, kKey);
}

TEST(RecordKeyTest, RefusesOtherText) {
  for (const char* text : {"", "2", "2.5f.30", "2.5f.30.", "2.5g.30.1", "2.5f.30.1x", "-2.5f.30.1", "a.5f.30.1",
                           "99999999999.5f.30.1", "2.5f3c9a1e0b7d4c2155.30.17"}) {
    EXPECT_FALSE(ParseRecordKey(text).has_value()) << text;
  }
}

TEST(RecordKeyTest, ComparesAsNumbersNotAsText) {
  RecordKey nine = kKey, ten = kKey;
  nine.seq = 9;
  ten.seq = 10;
  EXPECT_LT(nine, ten);
}

// The hash is stored on disks and sent on the wire, so it must never change.
TEST(RecordKeyTest, HashNeverChanges) {
  EXPECT_EQ(HashRecord(kKey, "moon"), HashRecord(kKey, "moon"));
  EXPECT_NE(HashRecord(kKey, "moon"), HashRecord(kKey, "noon"));
  RecordKey other = kKey;
  other.stream.origin = 3;
  EXPECT_NE(HashRecord(kKey, "moon"), HashRecord(other, "moon"));
  EXPECT_EQ(HashRecord(kKey, "moon"), 0x5219fca497c12228ull);
}

}  // namespace
}  // namespace moondb
