#include "actors/merge/gather_backend.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(GatherBackendTest, BackendsHaveNames) {
  for (const MergeBackend backend : {MergeBackend::kAuto, MergeBackend::kCpu, MergeBackend::kGl}) {
    EXPECT_EQ(ParseMergeBackend(ToString(backend)).value(), backend);
  }
  EXPECT_EQ(ParseMergeBackend("vulkan").error().code, ErrorCode::kInvalid);
}

TEST(GatherBackendTest, AutoResolvesToABackendOfThisMachine) {
  const MergeBackend resolved = ResolveMergeBackend(MergeBackend::kAuto);
  EXPECT_NE(resolved, MergeBackend::kAuto);
  const auto backend = CreateGatherBackend(MergeBackend::kAuto);
  ASSERT_TRUE(backend.has_value());
  EXPECT_EQ((*backend)->name(), ToString(resolved));
}

TEST(GatherBackendTest, AnExplicitBackendIsKept) {
  EXPECT_EQ(ResolveMergeBackend(MergeBackend::kGl), MergeBackend::kGl);
  EXPECT_EQ((*CreateGatherBackend(MergeBackend::kCpu))->name(), "cpu");
  const auto gl = CreateGatherBackend(MergeBackend::kGl);
  if (!gl) GTEST_SKIP() << ToString(gl.error());
  EXPECT_EQ((*gl)->name(), "gl");
}

}  // namespace
}  // namespace moondb
