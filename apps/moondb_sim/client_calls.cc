#include "apps/moondb_sim/client_calls.h"

#include <utility>
#include <vector>

namespace moondb::simulation {
namespace {

constexpr Duration kPollPeriod = std::chrono::seconds(1);

}  // namespace

void ClientCalls::Ask(AgentId agent, const proto::ControlRequest& request, Then then) {
  const std::uint64_t number = ++last_call_;
  const SendResult sent =
      world_.team.Post(ClientOf(number), {agent, actor_name::kGateway}, ClientMessage(number, request));
  if (sent != SendResult::kAccepted) return;
  Call call{agent, request, world_.team.now(), {}, true, std::move(then)};
  call.answer_by = call.asked + AnsweredWithin(request, kClientTimeout, kLongClientTimeout);
  for (auto& [other_number, other] : calls_) {
    if (other.asked == call.asked) other.is_alone = call.is_alone = false;
  }
  calls_.emplace(number, std::move(call));
}

void ClientCalls::Run() {
  world_.team.RunUntilIdle();
  TakeAnswers();
  CheckOverdue();
  if (calls_.empty() || std::exchange(is_polling_, true)) return;
  world_.In(kPollPeriod, [this] {
    is_polling_ = false;
    Run();
  });
}

void ClientCalls::TakeAnswers() {
  std::vector<std::pair<Then, Answer>> answered;
  std::erase_if(calls_, [&](const auto& entry) {
    const auto& [number, call] = entry;
    const std::vector<proto::Message> messages = world_.team.TakeMessages(ClientOf(number));
    if (messages.empty()) return false;
    const std::optional<proto::ControlReply> reply = ClientReplyIn(messages.front());
    if (messages.size() > 1 || !reply || messages.front().request_id() != number) {
      world_.Violate("answered", "agent " + std::to_string(call.agent) + " gives " + std::to_string(messages.size()) +
                                     " answers to one " + NameOf(call.request));
    }
    if (!reply) return true;
    CheckError(call, *reply);
    const Duration took = world_.team.now() - call.asked;
    answered.push_back({call.then, {*reply, call.is_alone && took == Duration::zero(), took}});
    return true;
  });
  for (const auto& [then, answer] : answered) then(answer);
}

void ClientCalls::CheckOverdue() {
  std::erase_if(calls_, [this](const auto& entry) {
    const Call& call = entry.second;
    if (world_.team.now() <= call.answer_by) return false;
    world_.Violate("answered", "agent " + std::to_string(call.agent) + " does not answer " + NameOf(call.request));
    return true;
  });
}

void ClientCalls::CheckError(const Call& call, const proto::ControlReply& reply) {
  const proto::Error& error = reply.error();
  if (!IsError(error)) return;
  const bool is_line = !error.text().empty() && error.text().find('\n') == std::string::npos;
  const auto asked = static_cast<AgentId>(call.request.for_agent() == 0 ? call.agent : call.request.for_agent());
  const bool may_be_internal = call.request.has_optimize() || world_.HadDiskTrouble(asked);
  if (is_line && (error.code() != proto::ERROR_CODE_INTERNAL || may_be_internal)) return;
  world_.Violate("clear_error", NameOf(call.request) + ": " + error.ShortDebugString());
}

void ClientCalls::Forget(AgentId agent) {
  std::erase_if(calls_, [agent](const auto& entry) { return entry.second.agent == agent; });
}

}  // namespace moondb::simulation
