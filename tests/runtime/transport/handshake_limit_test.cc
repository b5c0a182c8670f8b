#include "runtime/transport/handshake_limit.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

using std::chrono::seconds;

TEST(HandshakeLimitTest, AdmitsSixtyInAnyMinute) {
  HandshakeLimit limit;
  const MonotonicTime begin{};
  for (std::size_t i = 0; i < HandshakeLimit::kPerMinute; ++i) {
    const MonotonicTime now = begin + seconds(i / 2);  // Two handshakes per second.
    ASSERT_TRUE(limit.HasRoom("anna", now));
    limit.Count("anna", now);
  }
  EXPECT_FALSE(limit.HasRoom("anna", begin + seconds(59)));
  EXPECT_TRUE(limit.HasRoom("vera", begin + seconds(59))) << "each key has its own count";
  EXPECT_TRUE(limit.HasRoom("anna", begin + seconds(60))) << "the first two are a minute old";
  limit.Count("anna", begin + seconds(60));
  limit.Count("anna", begin + seconds(60));
  EXPECT_FALSE(limit.HasRoom("anna", begin + seconds(60)));
}

}  // namespace
}  // namespace moondb
