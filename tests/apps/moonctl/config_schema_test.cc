#include "apps/moonctl/config_schema.h"

#include <gmock/gmock.h>
#include <google/protobuf/struct.pb.h>
#include <google/protobuf/util/json_util.h>
#include <yaml-cpp/yaml.h>

#include <regex>

#include "model/text.h"

namespace moondb {
namespace {

using google::protobuf::Struct;
using testing::ElementsAre;
using testing::IsEmpty;

// Validates YAML against a JSON schema. Supports only the keywords that the team file's schema uses.
class Validator {
 public:
  Validator() { EXPECT_TRUE(google::protobuf::util::JsonStringToMessage(TeamFileSchema(), &root_).ok()); }

  std::vector<std::string> ErrorsIn(const std::string& yaml) {
    errors_.clear();
    Validate(root_, YAML::Load(yaml), "");
    return errors_;
  }

  const Struct& root() const { return root_; }

 private:
  static bool Has(const Struct& schema, const std::string& key) { return schema.fields().contains(key); }
  static double NumberIn(const Struct& schema, const std::string& key) {
    return schema.fields().at(key).number_value();
  }

  bool IsOfType(const std::string& type, const YAML::Node& node) {
    if (type == "object") return node.IsMap();
    if (type == "array") return node.IsSequence();
    if (type == "null") return node.IsNull();
    const std::string text = node.IsScalar() ? node.Scalar() : "";
    if (type == "boolean") return text == "true" || text == "false";
    if (type == "integer") return ParseUnsigned(text).has_value();
    return type == "number" ? ParseDouble(text).has_value() : !text.empty();
  }

  bool HasType(const Struct& schema, const YAML::Node& node) {
    const auto& types = schema.fields().at("type");
    if (types.kind_case() == google::protobuf::Value::kStringValue) return IsOfType(types.string_value(), node);
    for (const auto& type : types.list_value().values()) {
      if (IsOfType(type.string_value(), node)) return true;
    }
    return false;
  }

  void Add(const std::string& path, const std::string& what) { errors_.push_back(path + ": " + what); }

  void ValidateFields(const Struct& schema, const YAML::Node& node, const std::string& path) {
    const auto& properties = schema.fields().at("properties").struct_value().fields();
    EXPECT_FALSE(schema.fields().at("additionalProperties").bool_value());
    for (const auto& entry : node) {
      const std::string key = entry.first.Scalar();
      if (properties.contains(key)) {
        Validate(properties.at(key).struct_value(), entry.second, path + "." + key);
      } else {
        Add(path, "unknown " + key);
      }
    }
    for (const auto& required : schema.fields().at("required").list_value().values()) {
      if (!node[required.string_value()]) Add(path, "lacks " + required.string_value());
    }
  }

  void Validate(const Struct& schema, const YAML::Node& node, const std::string& path) {
    if (Has(schema, "$ref")) {
      const std::string name = schema.fields().at("$ref").string_value().substr(std::string("#/definitions/").size());
      return Validate(root_.fields().at("definitions").struct_value().fields().at(name).struct_value(), node, path);
    }
    if (Has(schema, "allOf")) {
      return Validate(schema.fields().at("allOf").list_value().values(0).struct_value(), node, path);
    }
    if (Has(schema, "enum")) {
      for (const auto& value : schema.fields().at("enum").list_value().values()) {
        if (node.IsScalar() && node.Scalar() == value.string_value()) return;
      }
      return Add(path, "no choice");
    }
    if (!HasType(schema, node)) return Add(path, "type");
    if (Has(schema, "pattern") &&
        !std::regex_search(node.Scalar(), std::regex(schema.fields().at("pattern").string_value()))) {
      Add(path, "pattern");
    }
    if (Has(schema, "minimum") && *ParseDouble(node.Scalar()) < NumberIn(schema, "minimum")) Add(path, "too small");
    if (Has(schema, "maximum") && *ParseDouble(node.Scalar()) > NumberIn(schema, "maximum")) Add(path, "too large");
    if (Has(schema, "minItems") && static_cast<double>(node.size()) < NumberIn(schema, "minItems")) Add(path, "few");
    if (Has(schema, "maxItems") && static_cast<double>(node.size()) > NumberIn(schema, "maxItems")) Add(path, "many");
    if (Has(schema, "properties") && node.IsMap()) ValidateFields(schema, node, path);
    if (!Has(schema, "items")) return;
    for (const auto& element : node) Validate(schema.fields().at("items").struct_value(), element, path + "[]");
  }

  Struct root_;
  std::vector<std::string> errors_;
};

TEST(ConfigSchemaTest, AcceptsTheCommentedTeamFile) {
  EXPECT_THAT(Validator().ErrorsIn(*ReadTextFile(MOONDB_CONFIGS "/cadre.yaml")), IsEmpty());
  EXPECT_THAT(Validator().ErrorsIn("{team: a, team_id: 00112233445566778899aabbccddeeff, agents: [{id: 1, name: b, "
                                   "address: 'ipc:///x'}], radio: }"),
              IsEmpty());
}

TEST(ConfigSchemaTest, RejectsInvalidTeamFiles) {
  Validator validator;
  EXPECT_THAT(validator.ErrorsIn("{team: Moon, team_id: 0x1, agents: []}"),
              ElementsAre(".team: pattern", ".team_id: pattern", ".agents: few"));
  EXPECT_THAT(validator.ErrorsIn("{agents: [{id: 0, name: b, kind: rovr}], sites: 1}"),
              ElementsAre(".agents[].id: too small", ".agents[].kind: no choice", ".agents[]: lacks address",
                          ": unknown sites", ": lacks team", ": lacks team_id"));
  EXPECT_THAT(validator.ErrorsIn("{team: a, team_id: 00112233445566778899aabbccddeeff, agents: [{id: 1, name: b, "
                                 "address: 'tcp://h:1', antenna_m: [1, x]}],"
                                 " share: {power: some}, map: {resolution_m: 11}, insecure: 1}"),
              ElementsAre(".agents[].antenna_m: few", ".agents[].antenna_m[]: type", ".share.power: no choice",
                          ".map.resolution_m: too large", ".insecure: type"));
}

TEST(ConfigSchemaTest, KnowsTheRangesOfTheCheck) {
  Validator validator;
  EXPECT_THAT(
      validator.ErrorsIn("{team: a, team_id: 00112233445566778899aabbccddeeff, agents: [{id: 1, name: b, "
                         "address: 'tcp://h:1', start: {x: 2e6, yaw: 7}, antenna_m: [0, 0, 101]}],"
                         " site: {north_yaw_rad: -7}, map: {footprint_m: [0, 1]}, keep: {power: soon},"
                         " radio: {states_period_s: 0}}"),
      ElementsAre(".agents[].start.x: too large", ".agents[].start.yaw: too large", ".agents[].antenna_m[]: too large",
                  ".site.north_yaw_rad: too small", ".map.footprint_m[]: too small", ".keep.power: pattern"));
}

TEST(ConfigSchemaTest, DescribesEveryField) {
  Validator validator;
  const auto check = [](const std::string& name, const Struct& schema) {
    for (const auto& [key, field] : schema.fields().at("properties").struct_value().fields()) {
      EXPECT_NE(field.struct_value().fields().at("description").string_value(), "") << name << "." << key;
    }
  };
  check("team", validator.root());
  for (const auto& [name, part] : validator.root().fields().at("definitions").struct_value().fields()) {
    check(name, part.struct_value());
  }
}

}  // namespace
}  // namespace moondb
