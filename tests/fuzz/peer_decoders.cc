#include "tests/fuzz/peer_decoders.h"

#include <algorithm>

#include "actors/gateway/command_table.h"
#include "actors/role/role_logic.h"
#include "model/check.h"
#include "model/control_message.h"
#include "model/record_check.h"
#include "model/term.h"
#include "proto/types.pb.h"
#include "runtime/address.h"
#include "runtime/team/record_signature.h"
#include "runtime/team/role_signature.h"
#include "runtime/team/signing_key.h"
#include "runtime/transport/inbound.h"
#include "tests/fuzz/decoders.h"

namespace moondb {
namespace {

constexpr AgentId kLeader = 1;
constexpr AgentId kSurvivor = 2;
constexpr AgentId kLiar = 3;
constexpr AgentId kBase = 4;
constexpr AgentId kSelf = 5;  // A rover without a role, like the attacker kLiar.

const RecordKey kQuarantineKey{{kLeader, 7, proto::MAP_QUARANTINE}, 3};

SigningKey KeyOf(AgentId agent) {
  SigningKey::Seed seed{};
  seed[0] = static_cast<std::uint8_t>(agent);
  return SigningKey::FromSeed(seed);
}

const proto::TeamConfig& Team() {
  static const proto::TeamConfig team = [] {
    proto::TeamConfig made;
    made.set_team_id("00112233445566778899aabbccddeeff");
    for (const AgentId id : {kLeader, kSurvivor, kLiar, kBase, kSelf}) {
      proto::AgentConfig& agent = *made.add_agents();
      agent.set_id(id);
      agent.set_name("agent" + std::to_string(id));
      agent.set_kind(id == kBase ? proto::AGENT_KIND_BASE_STATION : proto::AGENT_KIND_ROVER);
      agent.set_signing_key(KeyOf(id).public_key());
    }
    return made;
  }();
  return team;
}

RoleLogic::Options LogicOptions() {
  RoleLogic::Options options;
  options.self = kSelf;
  options.agents = {kLeader, kSurvivor, kLiar, kBase, kSelf};
  options.initial.set_leader(kLeader);
  options.initial.set_survivor(kSurvivor);
  options.check = [](const proto::RoleAssignment&) { return Result<void>(); };
  options.sign = [](const proto::RoleAssignment&) { return std::string("own"); };
  options.is_signed = [](const proto::RoleAssignment& roles) {
    return roles.term().issuer() == kLiar && !roles.signature().empty();
  };
  options.may_command = [](AgentId agent) { return agent == kBase; };
  return options;
}

RoleLogic::Actions Hear(RoleLogic& logic, AgentId sender, std::size_t kind, const std::string& bytes) {
  if (kind == 0) {
    proto::RoleAnnounce announce;
    if (!announce.ParseFromString(bytes)) return {};
    return logic.OnAnnounce(sender, announce).value_or(RoleLogic::Actions());
  }
  if (kind == 1) {
    proto::RoleChainReply reply;
    if (!reply.ParseFromString(bytes)) return {};
    return logic.OnChainReply(sender, reply).value_or(RoleLogic::Actions());
  }
  if (kind == 2) {
    proto::RoleChainRequest request;
    if (request.ParseFromString(bytes)) (void)logic.OnChainRequest(request);
    return {};
  }
  proto::RoleAssignment stored;
  if (!stored.ParseFromString(bytes) || !LogicOptions().is_signed(stored)) return {};
  return logic.OnRecord(stored);
}

}  // namespace

proto::Record FuzzedAssignment() {
  proto::Record record;
  proto::RoleAssignment& roles = *record.mutable_role_assignment();
  roles.mutable_term()->set_number(TermNumber(0, 7));
  roles.mutable_term()->set_issuer(kLeader);
  roles.mutable_term()->set_issuer_epoch(5);
  roles.set_leader(kSurvivor);
  roles.set_survivor(kLeader);
  roles.set_follows(std::string(kSignatureBytes, 'f'));
  roles.set_signature(KeyOf(kLeader).Sign(SignedBytes(Team(), roles)));
  return record;
}

proto::Record FuzzedQuarantine() {
  proto::Record record;
  record.set_timestamp_ns(1000);
  record.mutable_map_quarantine()->set_agent_id(kSurvivor);
  record.mutable_map_quarantine()->set_to_ns(9);
  record.mutable_map_quarantine()->set_reason("dust");
  record.mutable_map_quarantine()->set_signature(KeyOf(kLeader).Sign(SignedBytes(Team(), kQuarantineKey, record)));
  return record;
}

void RunPeerFrame(std::string_view bytes) {
  const bool is_known = TakeNumber(1, bytes) % 2 == 1;
  const auto messages = ParsePeerFrame(bytes, is_known ? std::optional(kLiar) : std::nullopt);
  if (!messages) return;
  for (const OwnedMessage& message : *messages) {
    Check(!is_known || message->hop_sender() == kLiar, "a peer speaks for itself alone");
    Check(message->client_rights() == proto::CLIENT_RIGHTS_NONE && message->client_name().empty(),
          "a peer gives nobody rights");
    Check(!message->has_insert_request() && !message->has_timer(), "what actors of one agent say stays there");
  }
}

void RunClientFrame(std::string_view bytes) {
  const auto message = ParseClientFrame(bytes, "7", {proto::CLIENT_RIGHTS_VIEW, "anna"}, kLeader);
  if (!message) return;
  Check((*message)->client_rights() == proto::CLIENT_RIGHTS_VIEW && (*message)->client_name() == "anna" &&
            (*message)->destination_actor() == actor_name::kGateway && (*message)->hop_sender() == kClients,
        "a client is who its key says, and speaks to the gateway");
  auto request = ControlRequestOf(**message);
  if (!request || !CheckRequest(Team(), kLeader, *request)) return;
  (void)CommandText(Team(), *request);
  (void)QuestionsOf(*std::move(request), /*is_relayed=*/bytes.size() % 2 == 0);
}

void RunSigned(std::string_view bytes) {
  proto::Record record;
  if (!record.ParseFromArray(bytes.data(), static_cast<int>(bytes.size()))) return;
  (void)CheckRecord(record);
  if (record.has_role_assignment() && IsSigned(Team(), record.role_assignment())) {
    Check(SignedBytes(Team(), record.role_assignment()) == SignedBytes(Team(), FuzzedAssignment().role_assignment()),
          "nobody else's assignment has a signature");
  }
  if (IsSigned(Team(), kQuarantineKey, record)) {
    Check(SignedBytes(Team(), kQuarantineKey, record) == SignedBytes(Team(), kQuarantineKey, FuzzedQuarantine()),
          "nobody else's quarantine has a signature");
  }
}

void RunChain(std::string_view bytes) {
  RoleLogic logic(LogicOptions());
  (void)logic.OnLoaded({}, /*own_epoch=*/9, /*now_ns=*/0);
  while (!bytes.empty()) {
    const AgentId sender = static_cast<AgentId>(1 + TakeNumber(1, bytes) % kBase);
    const std::size_t kind = TakeNumber(1, bytes) % 4;
    std::size_t size = TakeNumber(2, bytes);
    size = std::min(size, bytes.size());
    const RoleLogic::Actions actions = Hear(logic, sender, kind, std::string(bytes.substr(0, size)));
    bytes.remove_prefix(size);
    Check(!actions.save && !actions.apply, "a rover that never led moves nobody");
  }
  Check(logic.current().leader() == kLeader && logic.current().term().number() == 0, "the team file's roles stand");
}

}  // namespace moondb
