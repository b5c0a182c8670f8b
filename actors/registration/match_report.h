// MatchReport: what the leader has matched in its term, for clients. Not thread-safe.
#pragma once

#include <chrono>
#include <cstddef>
#include <map>
#include <string>

#include "actors/registration/map_matching.h"
#include "proto/registration.pb.h"

namespace moondb {

// Adds the verdicts that are not zero.
void AddCounts(const std::map<MatchVerdict, std::size_t>& counts,
               google::protobuf::RepeatedPtrField<proto::RegistrationCount>& out);

class MatchReport {
 public:
  void Clear() { *this = MatchReport(); }
  // Maps and matches that the leader held when a pass began.
  struct Inputs {
    std::size_t registered_count = 0;  // Maps with a pose.
    std::size_t unposed_count = 0;     // Maps without one.
    std::size_t removed_map_match_count = 0;
  };

  void OnPlanned(const Inputs& inputs, bool has_pairs);
  void OnMatched(MatchVerdict verdict) { ++counts_[verdict]; }
  void OnTime(std::chrono::nanoseconds spent) { spent_ += spent; }
  void OnStored(std::size_t count) { stored_count_ += count; }
  // Why there is no result; empty: there is one.
  void SetTrouble(std::string text) { trouble_ = std::move(text); }

  // Fills in everything but left_count, left_out and is_due. `map_count`: number of maps that the leader holds.
  proto::RegistrationReply ToReply(bool is_idle, std::size_t map_count) const;

 private:
  bool is_planned_ = false;  // A pass was planned in this term.
  Inputs inputs_;            // Inputs of the last pass.
  std::size_t pass_count_ = 0;
  std::size_t stored_count_ = 0;
  std::map<MatchVerdict, std::size_t> counts_;
  std::chrono::nanoseconds spent_{};
  std::string trouble_;
};

}  // namespace moondb
