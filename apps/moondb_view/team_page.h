// TeamPage: the part "team" of the page: the answers to the operator's questions, the table of agents, who has what,
// and the findings of `moonctl health`. Values that no agent has reported are unknown. Pure functions of the reports.
// Thread-safe.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "apps/moonctl/health.h"
#include "model/have_set.h"
#include "model/ids.h"
#include "proto/team.pb.h"

namespace moondb {

// Other agents are asked at long intervals. Older answers say nothing about now.
inline constexpr double kAnswerAgeMax_s = 120;

struct ReportedAgent {
  AgentReport report;                           // As for `moonctl health`.
  std::optional<proto::GraphStatsReply> graph;  // Set only for the leader.
  std::optional<HaveSet> holds;
  // The have-set of the own agent when this one was asked. Records that came later are no gap.
  std::optional<HaveSet> own_holds_then;
  double age_s = 0;  // Age of the answers.
};

struct ReportedBattery {
  std::optional<double> ratio;  // 0 to 1.
  double age_s = 0;             // Time since the robot measured it, by this machine's clock.
};

// The switch "ask the team".
struct RequestState {
  bool is_on = false;
  double cost_bytes = 0;   // Bytes that one round is expected to send over the radio.
  double spent_bytes = 0;  // Bytes that all rounds have sent.
  double period_s = 0;
  std::string trouble;  // The agents that did not answer in the last round, each with the reason.
};

struct TeamReports {
  AgentId agent = 0;                        // The agent to which moondb_view is connected.
  std::string why_silent;                   // Why that agent does not answer. Empty: it does.
  std::map<AgentId, ReportedAgent> agents;  // Agents that answered at least once.
  std::map<AgentId, ReportedBattery> batteries;
  std::map<AgentId, bool> is_placed;  // By the graph; absent: unknown.
  std::uint64_t viewers = 0;
  RequestState ask;
  double now_s = 0;  // Seconds since 1970.
};

std::string TeamPageJson(const proto::TeamConfig& team, const TeamReports& reports);

// The answers, each with its sentence. `is_good` is meaningless if the answer is not known.
struct Answer {
  bool is_known = false;
  bool is_good = false;
  std::string text;
};
Answer LossAnswer(const proto::TeamConfig& team, const TeamReports& reports);
Answer SilentAnswer(const proto::TeamConfig& team, const TeamReports& reports);
Answer MapsAnswer(const proto::TeamConfig& team, const TeamReports& reports);

}  // namespace moondb
