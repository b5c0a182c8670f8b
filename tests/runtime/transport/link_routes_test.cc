#include "runtime/transport/link_routes.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(LinkRoutesTest, TheConnectionThatBeganLastIsTheLink) {
  LinkRoutes routes;
  EXPECT_TRUE(routes.IsNewest(2, "a"));
  EXPECT_TRUE(routes.IsNewest(2, "a"));
  EXPECT_TRUE(routes.IsNewest(2, "b"));
  EXPECT_FALSE(routes.IsNewest(2, "a")) << "what was still on its way";
  EXPECT_TRUE(routes.IsNewest(2, "b"));
}

TEST(LinkRoutesTest, AgentsDoNotTakeEachOthersLinks) {
  LinkRoutes routes;
  EXPECT_TRUE(routes.IsNewest(2, "a"));
  EXPECT_TRUE(routes.IsNewest(3, "2"));
  EXPECT_TRUE(routes.IsNewest(3, "a"));
  EXPECT_TRUE(routes.IsNewest(2, "a"));
}

TEST(LinkRoutesTest, ManyConnectionsAreForgottenOneByOne) {
  LinkRoutes routes;
  for (int i = 0; i < 1000; ++i) EXPECT_TRUE(routes.IsNewest(2, std::to_string(i)));
  EXPECT_FALSE(routes.IsNewest(2, "990"));
}

}  // namespace
}  // namespace moondb
