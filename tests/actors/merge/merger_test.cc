#include "actors/merge/merger.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(MergerTest, BackendsHaveNames) {
  for (const MergeBackend backend : {MergeBackend::kAuto, MergeBackend::kCpu, MergeBackend::kGl}) {
    EXPECT_EQ(ParseMergeBackend(ToString(backend)).value(), backend);
  }
  EXPECT_EQ(ParseMergeBackend("vulkan").error().code, ErrorCode::kInvalid);
}

TEST(MergerTest, AutoMeansWhatThisMachineHas) {
  const MergeBackend resolved = ResolveMergeBackend(MergeBackend::kAuto);
  EXPECT_NE(resolved, MergeBackend::kAuto);
  const auto merger = CreateMerger(MergeBackend::kAuto);
  ASSERT_TRUE(merger.has_value());
  EXPECT_EQ((*merger)->name(), ToString(resolved));
}

TEST(MergerTest, ForcedBackendsStay) {
  EXPECT_EQ(ResolveMergeBackend(MergeBackend::kGl), MergeBackend::kGl);
  EXPECT_EQ((*CreateMerger(MergeBackend::kCpu))->name(), "cpu");
  const auto gl = CreateMerger(MergeBackend::kGl);
  if (!gl) GTEST_SKIP() << ToString(gl.error());
  EXPECT_EQ((*gl)->name(), "gl");
}

}  // namespace
}  // namespace moondb
