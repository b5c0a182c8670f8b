#include "model/custom_types.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/types.pb.h"

namespace moondb {
namespace {

CustomTypes Declared() {
  CustomTypes types;
  proto::CustomType& soil = *types.Add();
  soil.set_id(1000);
  soil.set_name("soil");
  soil.set_bytes_max(4);
  proto::CustomType& core = *types.Add();
  core.set_id(1999);
  core.set_name("core");
  core.set_bytes_max(4);
  return types;
}

TEST(CustomTypesTest, NamesDeclaredBuiltInAndUndeclaredTypes) {
  EXPECT_EQ(DataTypeName(1000, Declared()), "soil");
  EXPECT_EQ(DataTypeName(proto::POWER, Declared()), "power");
  EXPECT_EQ(DataTypeName(1500, Declared()), "type_1500");
  EXPECT_EQ(DataTypeFromName("soil", Declared()), 1000u);
  EXPECT_EQ(DataTypeFromName("power", Declared()), static_cast<DataType>(proto::POWER));
  EXPECT_EQ(DataTypeFromName("type_1500", Declared()), 1500u);
  for (const char* name : {"", "Soil", "type_", "type_1", "type_2000", "type_4294968296", "custom"}) {
    EXPECT_FALSE(DataTypeFromName(name, Declared())) << name;
  }
  EXPECT_THAT(DataTypeNames(Declared()), testing::IsSupersetOf({"temperature", "soil", "core"}));
}

TEST(CustomTypesTest, ListsDeclaredTypes) {
  proto::CustomRecord custom;
  custom.set_data_type(1000);
  custom.set_payload("1234");
  EXPECT_TRUE(CheckDeclared(custom, Declared()));
  custom.set_payload("12345");
  EXPECT_EQ(ToString(CheckDeclared(custom, Declared()).error()), "custom.payload: has 5 bytes; soil allows 4");
  custom.set_data_type(1001);
  EXPECT_EQ(ToString(CheckDeclared(custom, Declared()).error()),
            "custom.data_type: no custom type 1001; known are soil (1000), core (1999)");
  EXPECT_EQ(ToString(CheckDeclared(custom, {}).error()),
            "custom.data_type: no custom type 1001; the team file declares no data type of its own");
}

}  // namespace
}  // namespace moondb
