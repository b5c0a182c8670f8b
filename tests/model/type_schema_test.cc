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
  EXPECT_TRUE(DifferingTypes(schemas, turned).empty());
  EXPECT_NE(HashSchemas(schemas), HashSchemas(SchemasOf(Types({{1000, "soil"}}))));
}

TEST(TypeSchemaTest, TwoNamesOfOneIdDiffer) {
  const TypeSchemas soil = SchemasOf(Types({{1000, "soil"}, {1001, "dust"}}));
  const TypeSchemas rocks = SchemasOf(Types({{1000, "rocks"}, {1001, "dust"}}));
  EXPECT_NE(HashSchemas(soil), HashSchemas(rocks));
  EXPECT_EQ(DifferingTypes(soil, rocks), std::set<DataType>{1000});
}

TEST(TypeSchemaTest, ATypeThatOneDoesNotKnowDiffersFromNothing) {
  const TypeSchemas none = SchemasOf(Types({}));
  EXPECT_EQ(none.size(), static_cast<int>(BuiltInDataTypes().size()));
  EXPECT_TRUE(DifferingTypes(none, SchemasOf(Types({{1000, "soil"}}))).empty());
  EXPECT_TRUE(DifferingTypes(SchemasOf(Types({{1000, "soil"}})), none).empty());
}

TEST(TypeSchemaTest, ABuiltInTypeOfAnotherFormatDiffers) {
  const TypeSchemas ours = SchemasOf({});
  TypeSchemas theirs = ours;
  theirs[0].set_hash(theirs[0].hash() + 1);
  EXPECT_EQ(DifferingTypes(ours, theirs), std::set<DataType>{ours[0].data_type()});
}

}  // namespace
}  // namespace moondb
