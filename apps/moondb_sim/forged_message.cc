#include "apps/moondb_sim/forged_message.h"

#include <string>

#include "apps/moondb_sim/state_checker.h"
#include "proto/types.pb.h"

namespace moondb::simulation {
namespace {

constexpr std::size_t kGarbageBytesMax = 64 * 1024;

std::string DrawBytes(std::size_t count, std::mt19937_64& rng) {
  std::string bytes(count, '\0');
  for (char& byte : bytes) byte = static_cast<char>(rng());
  return bytes;
}

}  // namespace

proto::Record ForgedRecord(const RecordKey& key, AgentId named, const proto::Term& term, std::int64_t clock_ns,
                           std::mt19937_64& rng) {
  const auto draw = [&rng](std::uint64_t count) { return rng() % count; };
  proto::Record record;
  record.set_timestamp_ns(clock_ns + static_cast<std::int64_t>(draw(1'000'000'000)));
  switch (key.stream.type) {
    case proto::POWER:
      record.mutable_power()->set_battery_ratio(static_cast<double>(draw(1'000'000)) / 1e6);
      break;
    case proto::POSE_GRAPH_NODE: {
      proto::PoseGraphNode& node = *record.mutable_pose_graph_node();
      node.mutable_node()->set_agent_id(key.stream.origin);
      node.mutable_node()->set_index(kFarSeq + draw(kFarSeq));
      node.mutable_map_from_node()->mutable_position_m()->set_x(static_cast<double>(draw(1000)));
      node.mutable_map_from_node()->mutable_orientation()->set_w(1);
      break;
    }
    case proto::OPTIMIZED_POSE: {
      proto::OptimizedPose& pose = *record.mutable_optimized_pose();
      pose.mutable_node()->set_agent_id(named);
      pose.mutable_node()->set_index(draw(200));
      pose.mutable_map_from_node()->mutable_position_m()->set_x(1000 + static_cast<double>(draw(1000)));
      pose.mutable_map_from_node()->mutable_orientation()->set_w(1);
      *pose.mutable_term() = term;
      pose.set_run(kForgedRunMin + draw(1000));
      break;
    }
    case proto::AGENT_EVENT:
      record.mutable_agent_event()->set_kind(proto::EVENT_KIND_COMMAND);
      record.mutable_agent_event()->set_text("role swap");
      record.mutable_agent_event()->set_by("anna@hill (key)");
      break;
    case kBeacon:
      record.mutable_custom()->set_data_type(kBeacon);
      record.mutable_custom()->set_payload(std::to_string(rng()));
      break;
    default:
      record.mutable_map_quarantine()->set_agent_id(named);
      record.mutable_map_quarantine()->set_to_ns(record.timestamp_ns());
      record.mutable_map_quarantine()->set_from_ns(record.timestamp_ns() -
                                                   static_cast<std::int64_t>(draw(600)) * 1'000'000'000);
  }
  return record;
}

proto::Message DrawGarbage(std::mt19937_64& rng) {
  const auto draw = [&rng](std::uint64_t count) { return rng() % count; };
  proto::Message message;
  switch (draw(12)) {
    case 0:
      message.mutable_hello()->set_wire_version(static_cast<std::uint32_t>(rng()));
      break;
    case 1:
      message.mutable_have()->mutable_have()->add_streams()->add_held()->set_first(rng());
      break;
    case 2:
      message.mutable_batch()->set_coded(DrawBytes(draw(kGarbageBytesMax), rng));
      message.mutable_batch()->set_codec(static_cast<proto::Codec>(draw(6)));
      break;
    case 3:
      message.mutable_role_announce()->mutable_roles()->mutable_term()->set_number(rng());
      break;
    case 4:
      message.mutable_lease_announce()->set_driving_s(-1);
      message.mutable_lease_announce()->set_number(rng());
      break;
    case 5:
      message.mutable_clock_report()->set_utc_ns(static_cast<std::int64_t>(rng()));
      break;
    case 6:
      for (int i = 0; i < 100; ++i) message.mutable_epoch_report()->add_epochs(rng());
      break;
    case 7:
      message.mutable_leader_check()->set_is_reply(draw(2) == 0);
      break;
    case 8:
      message.set_control_request(DrawBytes(draw(200), rng));
      break;
    case 9:
      message.set_control_reply(DrawBytes(draw(200), rng));
      break;
    case 10:
      message.mutable_refusal()->set_session_id(rng());
      break;
    default:
      message.mutable_role_chain_request()->set_signature(DrawBytes(draw(200), rng));
  }
  message.set_request_id(rng());
  return message;
}

}  // namespace moondb::simulation
