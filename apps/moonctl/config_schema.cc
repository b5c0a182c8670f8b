#include "apps/moonctl/config_schema.h"

#include <google/protobuf/descriptor.h>

#include <map>
#include <optional>
#include <string_view>

#include "apps/common/json_writer.h"
#include "proto/team.pb.h"
#include "runtime/yaml_reader.h"

namespace moondb {
namespace {

using google::protobuf::Descriptor;
using google::protobuf::EnumDescriptor;
using google::protobuf::FieldDescriptor;

struct FieldFacts {
  std::string_view description;
  bool is_required = false;
  std::string_view pattern = "";
  std::optional<double> low = std::nullopt;  // Of a number.
  std::optional<double> high = std::nullopt;
  int items_min = 0;  // Of a list.
  int items_max = 0;  // 0: of none.
};

constexpr std::string_view kName = "^[a-z0-9_-]{1,32}$";
constexpr std::string_view kTeamId = "^[0-9a-f]{32}$";
constexpr std::string_view kKeep = "^(all|latest|[0-9.]+(d|h|m|min|s))$";
constexpr std::string_view kTypeName = "^[a-z][a-z0-9_]{0,31}$";

// By message and field; the ranges are those of runtime/team_check.cc.
const std::map<std::string_view, FieldFacts> kFacts = {
    {"TeamConfig.team",
     {.description = "The team's name: lower-case letters, digits, - and _", .is_required = true, .pattern = kName}},
    {"TeamConfig.team_id",
     {.description = "Tells this team from every other: made by moonctl config init, or config check --fix",
      .is_required = true,
      .pattern = kTeamId}},
    {"TeamConfig.agents",
     {.description = "All agents; the same file stands on each", .is_required = true, .items_min = 1, .items_max = 64}},
    {"TeamConfig.roles", {.description = "Who leads at the very beginning; roles that were set later win"}},
    {"TeamConfig.radio", {.description = "What the radio can carry"}},
    {"TeamConfig.share", {.description = "What rovers send to the leader, and the leader to the designated survivor"}},
    {"TeamConfig.ground", {.description = "What the base station is sent"}},
    {"TeamConfig.site", {.description = "Where the frame map lies, for maps with coordinates (GeoTIFF)"}},
    {"TeamConfig.map", {.description = "The merged map"}},
    {"TeamConfig.insecure", {.description = "true: no keys (CURVE); for tests on one machine only"}},
    {"TeamConfig.custom_types", {.description = "Data types of the team's own", .items_max = 64}},
    {"TeamConfig.retention", {.description = "What an agent need not keep for ever"}},
    {"TeamConfig.pose_graph", {.description = "The pose graph's solver"}},
    {"TeamConfig.keep",
     {.description = "What a robot's own disk keeps of its own states that newer ones have superseded under latest"}},
    {"AgentConfig.id",
     {.description = "For ever: records are named by it", .is_required = true, .low = 1, .high = 65535}},
    {"AgentConfig.name", {.description = "Lower-case letters, digits, - and _", .is_required = true, .pattern = kName}},
    {"AgentConfig.address",
     {.description = "Where it listens, and how the others reach it: tcp://HOST:PORT or ipc:///PATH",
      .is_required = true,
      .pattern = "^(tcp|ipc)://"}},
    {"AgentConfig.kind", {.description = "rover, the default, or base_station, of which there is at most one"}},
    {"AgentConfig.key",
     {.description = "The file of its public key, beside this file; the secret, NAME.sec, stays on its agent"}},
    {"AgentConfig.antenna_m",
     {.description = "x y z of the UWB antenna in the body's frame (m)", .items_min = 3, .items_max = 3}},
    {"AgentConfig.start", {.description = "A rover's pose in the frame map at its first pose-graph node"}},
    {"AgentConfig.position_m",
     {.description = "x y z of a base station in the frame map (m)", .items_min = 3, .items_max = 3}},
    {"AgentConfig.client_address",
     {.description = "Where clients with a listed key are let in: tcp://HOST:PORT", .pattern = "^tcp://"}},
    {"StartPose.x", {.description = "m, in the frame map"}},
    {"StartPose.y", {.description = "m, in the frame map"}},
    {"StartPose.z", {.description = "m, in the frame map"}},
    {"StartPose.yaw", {.description = "rad, in the frame map"}},
    {"StartPose.sigma_m", {.description = "How well the place is known (m)", .low = 1e-6, .high = 1000}},
    {"StartPose.sigma_rad", {.description = "How well the yaw is known (rad)", .low = 1e-6, .high = 10}},
    {"RolesConfig.leader", {.description = "A rover's name"}},
    {"RolesConfig.survivor", {.description = "The rover that keeps a copy of all that the leader has"}},
    {"RolesConfig.failover", {.description = "automatic: the survivor takes the lead of a leader that is silent"}},
    {"RolesConfig.leader_timeout_s", {.description = "How long it has to be silent (s)", .low = 1, .high = 86400}},
    {"RadioConfig.budget_kbps",
     {.description = "What one agent's sessions may send and receive together (kbit/s)", .low = 1, .high = 1000000}},
    {"RadioConfig.quiet_while_driving", {.description = "Nothing bulky is shared with an agent that drives"}},
    {"RadioConfig.states_period_s",
     {.description = "How often each agent sends the leader its latest states unasked (s); 0: never",
      .low = 0,
      .high = 86400}},
    {"RadioConfig.codec", {.description = "How agents code what they send; compact by default"}},
    {"CustomType.id",
     {.description = "For ever: records are named by it", .is_required = true, .low = 1000, .high = 1999}},
    {"CustomType.name",
     {.description = "Lower-case letters, digits and _, from a letter on", .is_required = true, .pattern = kTypeName}},
    {"CustomType.share", {.description = "As in share; all by default"}},
    {"CustomType.ground", {.description = "As in ground; none by default"}},
    {"CustomType.priority", {.description = "1 goes first among the custom types", .low = 1, .high = 9}},
    {"CustomType.bytes_max", {.description = "Of a payload", .low = 1, .high = 8388608}},
    {"CustomType.keep", {.description = "As in keep; all by default", .pattern = kKeep}},
    {"SiteConfig.lat_deg", {.description = "Latitude of the origin of the frame map (deg)", .low = -90, .high = 90}},
    {"SiteConfig.lon_deg",
     {.description = "Longitude of the origin of the frame map, east (deg)", .low = -180, .high = 360}},
    {"SiteConfig.north_yaw_rad", {.description = "The yaw of north in the frame map (rad)"}},
    {"RetentionConfig.keep_days",
     {.description = "Older records go, where leader and survivor have them (days); 0: none", .low = 0, .high = 36500}},
    {"RetentionConfig.keep_event_days", {.description = "The same for agent_event alone", .low = 0, .high = 36500}},
    {"RetentionConfig.store_mb_max",
     {.description = "The store's budget (MB): the oldest go, maps first; 0: as the disk allows",
      .low = 0,
      .high = 1e9}},
    {"RetentionConfig.map_part_max", {.description = "Of that budget, what maps may take", .low = 0, .high = 1}},
    {"RetentionConfig.disk_free_mb_min",
     {.description = "With less left on the disk an agent says so (MB)", .low = 0, .high = 1e9}},
    {"RetentionConfig.history_mb_max",
     {.description = "Superseded states that a robot's own disk keeps (MB): the oldest go first; 0: none are kept",
      .low = 0,
      .high = 1e6}},
    {"RetentionConfig.drop_beaten_maps",
     {.description = "Maps that win no cell of the merged map go when the budget is short"}},
    {"PoseGraphConfig.solve_by_itself",
     {.description = "The leader solves when records have stopped coming; else on moonctl graph optimize alone"}},
    {"MapConfig.resolution_m", {.description = "Side of the merged map's cells (m)", .low = 0.001, .high = 10}},
    {"MapConfig.footprint_m",
     {.description = "A rover's length and width (m): where it stood is free", .items_min = 2, .items_max = 2}},
};

FieldFacts FactsOf(const FieldDescriptor& field) {
  if (field.containing_type() == proto::SharePolicies::descriptor()) {
    return {.description = "none, latest (only the newest of each) or all"};
  }
  if (field.containing_type() == proto::KeepPolicies::descriptor()) {
    return {.description = "all, latest (nothing) or for how long: 7d, 12h", .pattern = kKeep};
  }
  const auto facts = kFacts.find(field.containing_type()->name() + "." + field.name());
  return facts == kFacts.end() ? FieldFacts{} : facts->second;
}

void WriteChoices(const EnumDescriptor& type, JsonWriter& json) {
  json.Key("enum").BeginArray();
  for (int i = 0; i < type.value_count(); ++i) {
    const std::string name = YamlName(*type.value(i));
    if (name != "unspecified") json.String(name);
  }
  json.EndArray();
}

// The members of one value's schema.
void WriteType(const FieldDescriptor& field, JsonWriter& json) {
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_MESSAGE:
      json.Key("$ref").String("#/definitions/" + field.message_type()->name());
      return;
    case FieldDescriptor::CPPTYPE_ENUM:
      return WriteChoices(*field.enum_type(), json);
    case FieldDescriptor::CPPTYPE_BOOL:
      json.Key("type").String("boolean");
      return;
    case FieldDescriptor::CPPTYPE_UINT32:
      json.Key("type").String("integer");
      return;
    case FieldDescriptor::CPPTYPE_DOUBLE:
      json.Key("type").String("number");
      return;
    default:
      json.Key("type").String("string");
  }
}

void WriteLimits(const FieldFacts& facts, JsonWriter& json) {
  if (!facts.pattern.empty()) json.Key("pattern").String(facts.pattern);
  if (facts.low) json.Key("minimum").Number(*facts.low);
  if (facts.high) json.Key("maximum").Number(*facts.high);
  if (facts.items_min > 0) json.Key("minItems").Number(facts.items_min);
  if (facts.items_max > 0) json.Key("maxItems").Number(facts.items_max);
}

void WriteField(const FieldDescriptor& field, JsonWriter& json) {
  const FieldFacts facts = FactsOf(field);
  json.Key(field.name()).BeginObject().Key("description").String(facts.description);
  // Draft 7 overlooks what stands beside a reference.
  const bool is_reference = !field.is_repeated() && field.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
  if (field.is_repeated()) {
    json.Key("type").String("array").Key("items").BeginObject();
    WriteType(field, json);
    json.EndObject();
  } else if (is_reference) {
    json.Key("allOf").BeginArray().BeginObject();
    WriteType(field, json);
    json.EndObject().EndArray();
  } else {
    WriteType(field, json);
  }
  WriteLimits(facts, json);
  json.EndObject();
}

void WriteMembers(const Descriptor& type, JsonWriter& json) {
  json.Key("type").BeginArray().String("object").String("null").EndArray();  // "radio:" with all commented out.
  json.Key("additionalProperties").Bool(false).Key("properties").BeginObject();
  for (int i = 0; i < type.field_count(); ++i) WriteField(*type.field(i), json);
  json.EndObject().Key("required").BeginArray();
  for (int i = 0; i < type.field_count(); ++i) {
    if (FactsOf(*type.field(i)).is_required) json.String(type.field(i)->name());
  }
  json.EndArray();
}

}  // namespace

std::string TeamFileSchema() {
  JsonWriter json;
  json.BeginObject().Key("$schema").String("http://json-schema.org/draft-07/schema#");
  json.Key("title").String("Team file of moondb").Key("definitions").BeginObject();
  const Descriptor& team = *proto::TeamConfig::descriptor();
  for (int i = 0; i < team.file()->message_type_count(); ++i) {
    const Descriptor& part = *team.file()->message_type(i);
    if (&part == &team) continue;
    json.Key(part.name()).BeginObject();
    WriteMembers(part, json);
    json.EndObject();
  }
  json.EndObject();
  WriteMembers(team, json);
  return json.EndObject().text();
}

}  // namespace moondb
