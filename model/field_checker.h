// FieldChecker: validates fields of a record. Take() returns the first violation as kInvalid, with the path of the
// field; success if there is none. Value type.
#pragma once

#include <string>

#include "model/error.h"
#include "model/ids.h"
#include "proto/ids.pb.h"
#include "proto/pose.pb.h"
#include "proto/term.pb.h"

namespace moondb {

class FieldChecker {
 public:
  void Require(bool is_met, const std::string& field, const std::string& text);

  void Finite(double value, const std::string& field);
  // Requires a number from 0 to 1.
  void Ratio(double value, const std::string& field);
  void Size(const std::string& bytes, std::size_t bytes_max, const std::string& field);
  // Requires UTF-8 of at most `bytes_max` bytes.
  void Text(const std::string& text, std::size_t bytes_max, const std::string& field);
  void Agent(AgentId agent, const std::string& field);
  void Node(const proto::NodeKey& node, const std::string& field);
  void Term(const proto::Term& term, const std::string& field);
  // Requires finite coordinates of at most kCoordinateMax_m (model/geometry.h).
  void Position(const proto::Vector3& position_m, const std::string& field);
  void Pose(const proto::Pose& pose, const std::string& field);
  // Records an error that another function found in a nested part of `field`.
  void Stop(const Error& error, const std::string& field);

  Result<void> Take() const { return result_; }

 private:
  Result<void> result_;
};

}  // namespace moondb
