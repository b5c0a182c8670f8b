// ReadYaml: one YAML document into a protobuf message, by reflection.
//
// Keys are the message's field names; enumeration values are written in lower case without the enumeration's own
// prefix (`base_station` for AGENT_KIND_BASE_STATION), and the UNSPECIFIED one cannot be written. Unlike yaml-cpp
// alone it takes nothing silently: unknown and doubled keys, wrong types, non-finite and overlong numbers are errors,
// all reported at once with their places; an error of YAML's syntax stands alone. Only what team files need is
// supported: messages, repeated fields, text (ASCII), bool, uint32, double, enumerations, and maps whose keys are the
// values of an enumeration (FieldRule::keys).
#pragma once

#include <google/protobuf/message.h>

#include <map>
#include <string>
#include <vector>

#include "runtime/team/placed_errors.h"

namespace moondb {

// Where the value of each field that the file gives stands, by path ("agents[1].id"). Well read or not.
using Places = std::map<std::string, Place>;

// The place of `field`, or of the nearest thing around it that the file gives.
Place PlaceOf(const Places& places, std::string field);

// Adds to `errors` what is wrong; what is right is in `message` all the same.
void ReadYaml(const std::string& yaml, google::protobuf::Message* message, Places* places, PlacedErrors* errors);

// Reads one field as a file could give it: "true", "[0, 0, 0]". What cannot be read is a programmer's error.
void ReadYamlField(const std::string& yaml, const google::protobuf::FieldDescriptor& field,
                   google::protobuf::Message* message);

// The keys that a map may have, in the order of the enumeration.
std::vector<std::string> KeysOf(const google::protobuf::FieldDescriptor& map);

// "base_station" for AGENT_KIND_BASE_STATION.
std::string YamlName(const google::protobuf::EnumValueDescriptor& value);

}  // namespace moondb
