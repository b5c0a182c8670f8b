#include "model/g2o_id.h"

#include <gtest/gtest.h>

#include "model/pyfg.h"

namespace moondb {
namespace {

std::string KeyOf(std::uint64_t id) {
  const std::optional<NodeKey> node = NodeOfId(id);
  if (!node) return "none";
  return node->agent == 0 ? std::to_string(node->index) : FormatKey(*node);
}

TEST(G2oIdTest, ReadsSymbolsLabeledSymbolsAndPlainIds) {
  EXPECT_EQ(KeyOf(7061644215716937729u), "b1");  // symbol('b', 1) of GTSAM.
  EXPECT_EQ(KeyOf(27303072740933632u), "a0");    // LabeledSymbol(0, 'a', 0) of GTSAM.
  EXPECT_EQ(KeyOf(27303072740933634u), "a2");
  EXPECT_EQ(KeyOf(std::uint64_t{'x'} << 56 | std::uint64_t{'B'} << 48 | 7), "B7") << "the label is the robot";
  EXPECT_EQ(KeyOf(0), "0");
  EXPECT_EQ(KeyOf(kPlainIdMax), "4294967295");
}

TEST(G2oIdTest, OtherIdsNameNoNode) {
  EXPECT_EQ(KeyOf(kPlainIdMax + 1), "none");
  EXPECT_EQ(KeyOf(std::uint64_t{1} << 48), "none") << "the label is no letter";
  EXPECT_EQ(KeyOf(std::uint64_t{'x'} << 56 | std::uint64_t{'1'} << 48), "none") << "the label is a digit";
  EXPECT_EQ(KeyOf(1700000000000000000u), "none") << "a timestamp in nanoseconds";
  EXPECT_EQ(KeyOf(UINT64_MAX), "none");
}

TEST(G2oIdTest, ASymbolIsReadBackAsTheSameNode) {
  for (const NodeKey& key : {NodeKey{1, 0}, NodeKey{26, 5}, NodeKey{27, kSymbolIndexMax}, NodeKey{52, 1}}) {
    EXPECT_EQ(NodeOfId(SymbolOf(key)), key);
  }
}

TEST(G2oIdTest, NamesVerticesWithTheirRobotIfTheyHaveOne) {
  EXPECT_EQ(NameOfId(7061644215716937729u), "b1 (id 7061644215716937729)");
  EXPECT_EQ(NameOfId(17), "17");
  EXPECT_EQ(NameOfId(UINT64_MAX), "18446744073709551615");
}

}  // namespace
}  // namespace moondb
