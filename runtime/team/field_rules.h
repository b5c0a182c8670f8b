// Applies the field rules of proto/field_options.proto to a message that was read from YAML (yaml_reader.h).
// Thread-safe.
#pragma once

#include <google/protobuf/message.h>

#include <string>

#include "proto/field_options.pb.h"
#include "runtime/team/yaml_reader.h"

namespace moondb {

const proto::FieldRule& RuleOf(const google::protobuf::FieldDescriptor& field);

// Adds an error to `errors` for each missing required key, each number outside its range and each list of wrong length.
void CheckFields(const google::protobuf::Message& message, const Places& places, PlacedErrors* errors);

// Sets each field of `message` that has a default and is not in `places`. Creates missing top-level sections that have
// defaults, but no nested messages.
void FillFields(const Places& places, google::protobuf::Message* message);

// Clears all additions (FieldRule.is_addition) of a message whose defaults are filled in. Returns those that differ
// from their defaults, with their paths, as bytes to hash.
std::string TakeAdditions(google::protobuf::Message* message);

// Returns the same bytes for equal messages, which SerializeAsString does not guarantee for maps.
std::string SerializeInOrder(const google::protobuf::Message& message);

// Returns the Places of a message that was not read from a file. They contain each field that is set and each bool of a
// present section. A number that is 0 counts as missing, because proto3 does not distinguish 0 from missing.
Places PlacesOf(const google::protobuf::Message& message);

}  // namespace moondb
