// Applies the field rules of proto/field_options.proto to a message that was read from YAML (yaml_reader.h). Pure
// functions, thread-safe.
#pragma once

#include <google/protobuf/message.h>

#include <string>

#include "proto/field_options.pb.h"
#include "runtime/team/yaml_reader.h"

namespace moondb {

const proto::FieldRule& RuleOf(const google::protobuf::FieldDescriptor& field);

// Adds to `errors` each missing required key, number outside its range and list of wrong length.
void CheckFields(const google::protobuf::Message& message, const Places& places, PlacedErrors* errors);

// Sets each field that has a default and is not in `places`. Creates missing top-level sections that have defaults, but
// no nested messages.
void FillFields(const Places& places, google::protobuf::Message* message);

// Returns places for a message that was not read from a file: fields that are set count as given. In proto3 a number
// that is 0 cannot be distinguished from a missing one, so it counts as missing. Every bool of a present section counts
// as given.
Places PlacesOf(const google::protobuf::Message& message);

}  // namespace moondb
