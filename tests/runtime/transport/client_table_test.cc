#include "runtime/transport/client_table.h"

#include <gtest/gtest.h>

namespace moondb {
namespace {

TEST(ClientTableTest, KeepsOneNamePerConnectionUntilItIsForgotten) {
  ClientTable table(4, 4, "k");
  EXPECT_EQ(table.NameOf("a", "anna"), "k1");
  EXPECT_EQ(table.NameOf("b", "anna"), "k2");
  EXPECT_EQ(table.NameOf("a", "anna"), "k1");
  EXPECT_EQ(table.RoutingIdOf("k2"), "b");
  table.Forget("b");
  table.Forget("b");
  EXPECT_EQ(table.RoutingIdOf("k2"), std::nullopt);
  EXPECT_EQ(table.NameOf("b", "anna"), "k3");
}

TEST(ClientTableTest, ForgetsTheConnectionThatWasSilentLongest) {
  ClientTable table(2, 2);
  table.NameOf("a", "");
  table.NameOf("b", "");
  table.NameOf("a", "");
  table.NameOf("c", "");
  EXPECT_EQ(table.RoutingIdOf("1"), "a");
  EXPECT_EQ(table.RoutingIdOf("2"), std::nullopt);
  EXPECT_EQ(table.RoutingIdOf("3"), "c");
}

TEST(ClientTableTest, ConnectionsOfOneKeyDoNotEvictThoseOfAnother) {
  ClientTable table(8, 3);
  const std::string carl = table.NameOf("carl", "carl's key");
  for (int i = 0; i < 300; ++i) table.NameOf("mallory" + std::to_string(i), "mallory's key");
  EXPECT_EQ(table.RoutingIdOf(carl), "carl");
  EXPECT_EQ(table.RoutingIdOf("301"), "mallory299");
  EXPECT_EQ(table.RoutingIdOf("298"), std::nullopt) << "its own ones gave way";
}

TEST(ClientTableTest, AFullTableEvictsAConnectionOfTheOwnerWithTheMost) {
  ClientTable table(4, 3);
  for (int i = 1; i <= 3; ++i) table.NameOf("m" + std::to_string(i), "mallory");
  table.NameOf("carl", "carl");
  table.NameOf("anna", "anna");
  EXPECT_EQ(table.RoutingIdOf("1"), std::nullopt);
  EXPECT_EQ(table.RoutingIdOf("4"), "carl");
  EXPECT_EQ(table.RoutingIdOf("5"), "anna");
}

}  // namespace
}  // namespace moondb
