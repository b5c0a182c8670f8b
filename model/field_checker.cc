#include "model/field_checker.h"

#include <cmath>

#include "model/geometry.h"
#include "model/term.h"
#include "model/text.h"
#include "proto/ids.pb.h"
#include "proto/pose.pb.h"

namespace moondb {

void FieldChecker::Require(bool is_met, const std::string& field, const std::string& text) {
  if (!is_met && result_) result_ = Fail(ErrorCode::kInvalid, text, field);
}

void FieldChecker::Finite(double value, const std::string& field) {
  Require(std::isfinite(value), field, "is not finite");
}

void FieldChecker::Ratio(double value, const std::string& field) {
  Require(value >= 0 && value <= 1, field, "must lie between 0 and 1");
}

void FieldChecker::Size(const std::string& bytes, std::size_t bytes_max, const std::string& field) {
  Require(bytes.size() <= bytes_max, field, "is longer than " + std::to_string(bytes_max) + " bytes");
}

void FieldChecker::Text(const std::string& text, std::size_t bytes_max, const std::string& field) {
  Size(text, bytes_max, field);
  Require(IsUtf8(text), field, "is not UTF-8");
}

void FieldChecker::Agent(AgentId agent, const std::string& field) {
  Require(agent >= 1 && agent <= kAgentIdMax, field, "must be 1 to " + std::to_string(kAgentIdMax));
}

void FieldChecker::Node(const proto::NodeKey& node, const std::string& field) {
  Agent(node.agent_id(), field + ".agent_id");
}

void FieldChecker::Term(const proto::Term& term, const std::string& field) {
  Agent(term.issuer(), field + ".issuer");
  Require(term.number() <= kTermNumberMax, field + ".number", "is above the largest term number");
}

void FieldChecker::Position(const proto::Vector3& position_m, const std::string& field) {
  for (const double coordinate : {position_m.x(), position_m.y(), position_m.z()}) {
    // The comparison is false for NaN.
    Require(std::abs(coordinate) <= kCoordinateMax_m, field, "must lie between -1e9 and 1e9 m");
  }
}

void FieldChecker::Pose(const proto::Pose& pose, const std::string& field) {
  const Result<moondb::Pose> read = FromProto(pose);
  if (!read) Stop(read.error(), field);
}

void FieldChecker::Stop(const Error& error, const std::string& field) {
  Require(false, field + "." + error.field, error.text);
}

}  // namespace moondb
