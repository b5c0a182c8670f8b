#include "actors/merge/gl_objects.h"

#include <gtest/gtest.h>

#include "actors/merge/egl_context.h"

namespace moondb {
namespace {

// Skips its tests if this machine has no OpenGL driver.
class GlObjectsTest : public testing::Test {
 protected:
  void SetUp() override {
    Result<std::unique_ptr<EglContext>> created = EglContext::Create();
    if (!created) GTEST_SKIP() << ToString(created.error());
    context_ = std::move(*created);
  }

  std::unique_ptr<EglContext> context_;
};

TEST_F(GlObjectsTest, AnOwnerDeletesItsGlName) {
  const CurrentContext current(*context_);
  GLuint id = 0;
  {
    const GlBuffer buffer = MakeBuffer();
    id = buffer.id();
    glBindBuffer(GL_ARRAY_BUFFER, id);
    EXPECT_EQ(glIsBuffer(id), GL_TRUE);
  }
  EXPECT_EQ(glIsBuffer(id), GL_FALSE);
  EXPECT_TRUE(CheckGl("testing"));
}

struct CountingTraits {
  static void Delete(GLuint) { ++deleted; }
  static inline int deleted = 0;
};

// After a context is lost, its GlObjects are destroyed while no context is current.
TEST_F(GlObjectsTest, AnOwnerWithoutAContextCallsNoGlFunction) {
  CountingTraits::deleted = 0;
  { const GlObject<CountingTraits> object(7); }
  EXPECT_FALSE(IsContextCurrent());
  EXPECT_EQ(CountingTraits::deleted, 0);
  const CurrentContext current(*context_);
  { const GlObject<CountingTraits> object(7); }
  EXPECT_TRUE(IsContextCurrent());
  EXPECT_EQ(CountingTraits::deleted, 1);
}

}  // namespace
}  // namespace moondb
