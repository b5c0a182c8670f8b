// SampleRecord returns a valid record of any built-in type. It uses reflection, so new types are covered automatically.
//
// In a sample record, every number is 0.5 or 1, every enumeration has its last value, every text is "text", and every
// agent is the given one. Types for which such a record is invalid are handled separately.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "model/geometry.h"
#include "model/ids.h"
#include "model/traversability_map.h"
#include "proto/record.pb.h"

namespace moondb {

inline void FillWithSamples(AgentId agent, google::protobuf::Message& message) {
  using google::protobuf::FieldDescriptor;
  const auto& type = *message.GetDescriptor();
  const auto& reflection = *message.GetReflection();
  for (int i = 0; i < type.field_count(); ++i) {
    const FieldDescriptor* field = type.field(i);
    if (field->is_repeated() || field->containing_oneof() != nullptr) continue;
    switch (field->cpp_type()) {
      case FieldDescriptor::CPPTYPE_DOUBLE:
        reflection.SetDouble(&message, field, 0.5);
        break;
      case FieldDescriptor::CPPTYPE_UINT32:
        reflection.SetUInt32(&message, field, agent);
        break;
      case FieldDescriptor::CPPTYPE_UINT64:
        reflection.SetUInt64(&message, field, 1);
        break;
      case FieldDescriptor::CPPTYPE_INT64:
        reflection.SetInt64(&message, field, 1);
        break;
      case FieldDescriptor::CPPTYPE_BOOL:
        reflection.SetBool(&message, field, true);
        break;
      case FieldDescriptor::CPPTYPE_ENUM:
        reflection.SetEnum(&message, field, field->enum_type()->value(field->enum_type()->value_count() - 1));
        break;
      case FieldDescriptor::CPPTYPE_STRING:
        reflection.SetString(&message, field, "text");
        break;
      case FieldDescriptor::CPPTYPE_MESSAGE:
        FillWithSamples(agent, *reflection.MutableMessage(&message, field));
        break;
      default:
        ADD_FAILURE() << "tests/sample_record.h knows no sample of " << field->full_name();
    }
  }
}

inline proto::Record SampleRecord(DataType type, AgentId agent) {
  proto::Record record;
  record.set_timestamp_ns(1);
  const auto* field = proto::Record::descriptor()->FindFieldByName(DataTypeName(type));
  if (field == nullptr) return record;
  FillWithSamples(agent, *record.GetReflection()->MutableMessage(&record, field));
  if (record.has_pose_graph_edge()) {
    proto::PoseGraphEdge& edge = *record.mutable_pose_graph_edge();
    edge.mutable_to()->set_agent_id(agent + 1);
    edge.mutable_range()->set_range_m(1);
    edge.mutable_range()->set_variance_m2(1);
    edge.clear_source();  // Ranges have none.
  }
  if (record.has_edge_verdict()) record.mutable_edge_verdict()->set_is_prior(false);  // Verdict on a range.
  if (record.has_pose_prior()) {
    proto::PosePrior& prior = *record.mutable_pose_prior();
    prior.mutable_position_m()->set_x(0.5);
    for (const double number : {1, 0, 0, 1, 0, 1}) prior.add_covariance(number);
  }
  if (record.has_map_match()) {
    proto::MapMatch& match = *record.mutable_map_match();
    match.mutable_to()->set_index(2);
    match.mutable_from_map()->set_data_type(proto::LOCAL_TRAVERSABILITY_MAP);
    match.mutable_to_map()->set_data_type(proto::LOCAL_TRAVERSABILITY_MAP);
    for (int row = 0; row < 6; ++row) {
      for (int column = row; column < 6; ++column) {
        match.mutable_relative_pose()->add_covariance(row == column ? 0.01 : 0);
      }
    }
  }
  if (record.has_local_traversability_map()) {
    const TraversabilityMap map{NodeKey{agent, 1}, Pose(), {MapLayer{Grid(5, 3, Cell::kFree), 50'000, 0, 0}}};
    *record.mutable_local_traversability_map() = ToProto(map);
  }
  if (record.has_map_quarantine()) {
    record.mutable_map_quarantine()->clear_lifts();
    // The agent that stores the record sets the signature and the term.
    record.mutable_map_quarantine()->clear_signature();
    record.mutable_map_quarantine()->clear_term();
  }
  if (record.has_role_assignment()) record.mutable_role_assignment()->set_survivor(agent + 1);
  return record;
}

}  // namespace moondb
