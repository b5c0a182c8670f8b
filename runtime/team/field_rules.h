// What proto/field_options.proto says of single fields, applied to a message that was read from YAML (yaml_reader.h).
// Pure functions, any thread.
#pragma once

#include <google/protobuf/message.h>

#include <string>

#include "proto/field_options.pb.h"
#include "runtime/team/yaml_reader.h"

namespace moondb {

const proto::FieldRule& RuleOf(const google::protobuf::FieldDescriptor& field);

// Adds to `errors` each required key that is missing, number out of its range and list of a wrong length.
void CheckFields(const google::protobuf::Message& message, const Places& places, PlacedErrors* errors);

// Sets each field that has a default and is not in `places`. Sections of the file are made where they lack, parts of
// them are not.
void FillFields(const Places& places, google::protobuf::Message* message);

// The places of a message that no file gave: what is set counts as given. proto3 cannot tell a zero from nothing; a
// `false` in a section that is there counts as given too.
Places PlacesOf(const google::protobuf::Message& message);

}  // namespace moondb
