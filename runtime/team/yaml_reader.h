// ReadYaml: reads one YAML document into a protobuf message, by reflection.
//
// Keys are the message's field names. Enumeration values are written in lower case without the enumeration's prefix
// (`base_station` for AGENT_KIND_BASE_STATION). UNSPECIFIED values cannot be written. Unknown and duplicate keys, wrong
// types, and non-finite or too long numbers are errors. All errors are reported together with their places; a YAML
// syntax error is reported alone.
//
// Supports only the features that team files need: messages, repeated fields, text (ASCII), bool, uint32, double,
// enumerations, and maps whose keys are the values of an enumeration (FieldRule::keys).
#pragma once

#include <google/protobuf/message.h>

#include <map>
#include <string>
#include <vector>

#include "runtime/team/placed_errors.h"

namespace moondb {

// Places of the values in a file, by field path ("agents[1].id"). Includes values with errors.
using Places = std::map<std::string, Place>;

// Returns the place of `field`. If `places` does not contain `field`, returns the place of the nearest enclosing field
// in `places`, or the start of the file if there is none.
Place PlaceOf(const Places& places, std::string field);

// Reads the valid fields into `message`, and adds an error for each invalid field.
void ReadYaml(const std::string& yaml, google::protobuf::Message* message, Places* places, PlacedErrors* errors);

// Reads the value of one field from text such as "true" or "[0, 0, 0]". Fails a Check if the text cannot be read.
void ReadYamlField(const std::string& yaml, const google::protobuf::FieldDescriptor& field,
                   google::protobuf::Message* message);

// Returns the keys that entries of `map` may have, in the order of the enumeration.
std::vector<std::string> KeysOf(const google::protobuf::FieldDescriptor& map);

// Returns the name of a value in YAML, such as "base_station" for AGENT_KIND_BASE_STATION.
std::string YamlName(const google::protobuf::EnumValueDescriptor& value);

}  // namespace moondb
