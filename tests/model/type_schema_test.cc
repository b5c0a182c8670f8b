#include "model/type_schema.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace moondb {
namespace {

CustomTypes Types(std::initializer_list<std::pair<DataType, const char*>> named) {
  CustomTypes types;
  for (const auto& [id, name] : named) {
    proto::CustomType& type = *types.Add();
    type.set_id(id);
    type.set_name(name);
  }
  return types;
}

TEST(TypeSchemaTest, TheSameTypesHaveOneHashWhateverTheirOrder) {
  const TypeSchemas schemas = SchemasOf(Types({{1000, "soil"}, {1001, "dust"}}));
  const TypeSchemas turned = SchemasOf(Types({{1001, "dust"}, {1000, "soil"}}));
  EXPECT_EQ(HashSchemas(schemas), HashSchemas(turned));
  EXPECT_TRUE(TypesNotFor(schemas, turned).empty());
  EXPECT_NE(HashSchemas(schemas), HashSchemas(SchemasOf(Types({{1000, "soil"}}))));
}

TEST(TypeSchemaTest, TwoNamesOfOneIdDiffer) {
  const TypeSchemas soil = SchemasOf(Types({{1000, "soil"}, {1001, "dust"}}));
  const TypeSchemas rocks = SchemasOf(Types({{1000, "rocks"}, {1001, "dust"}}));
  EXPECT_NE(HashSchemas(soil), HashSchemas(rocks));
  EXPECT_EQ(TypesNotFor(soil, rocks), std::set<DataType>{1000});
}

TEST(TypeSchemaTest, AgentsForwardUnknownCustomTypesButNotBuiltInOnes) {
  TypeSchemas none = SchemasOf(Types({}));
  EXPECT_EQ(none.size(), static_cast<int>(BuiltInDataTypes().size()));
  EXPECT_TRUE(TypesNotFor(none, SchemasOf(Types({{1000, "soil"}}))).empty());
  EXPECT_TRUE(TypesNotFor(SchemasOf(Types({{1000, "soil"}})), none).empty());
  const DataType last = none.rbegin()->data_type();
  none.RemoveLast();  // `none` now lists the schemas of an agent that lacks the last type.
  EXPECT_EQ(TypesNotFor(SchemasOf(Types({})), none), std::set<DataType>{last});
  EXPECT_TRUE(TypesNotFor(none, SchemasOf(Types({}))).empty());
  EXPECT_TRUE(TypesNotFor(SchemasOf(Types({})), {}).empty()) << "none reported: the same";
}

TEST(TypeSchemaTest, ABuiltInTypeOfAnotherNameDiffers) {
  const TypeSchemas ours = SchemasOf({});
  TypeSchemas theirs = ours;
  theirs[0].set_hash(theirs[0].hash() + 1);
  EXPECT_EQ(TypesNotFor(ours, theirs), std::set<DataType>{ours[0].data_type()});
}

}  // namespace
}  // namespace moondb
