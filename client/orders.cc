#include "client/orders.h"

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

#include "model/control_request.h"
#include "model/role_confirmation.h"
#include "model/term.h"
#include "proto/status.pb.h"

namespace moondb {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

// Pauses between attempts. A new leader stores its term and waits for its peers for up to 2 s before it acts.
constexpr milliseconds kPauses[] = {milliseconds(100), milliseconds(300), milliseconds(1000), milliseconds(2000),
                                    milliseconds(3000)};
constexpr char kExpectedTerm[] = "expected_term";  // Error::field if an order to share relies on outdated roles.
constexpr char kExpected[] = "expected";           // Error::field if a change of roles relies on outdated roles.
constexpr milliseconds kRolesPeriod(200);

double SecondsUntil(Clock::time_point end, double max_s) {
  return std::clamp(std::chrono::duration<double>(end - Clock::now()).count(), 0.0, max_s);
}

// Returns whether another attempt may succeed after this error.
bool IsWorthAnother(const Error& error) {
  return error.field == kExpectedTerm || error.code == ErrorCode::kUnavailable || error.code == ErrorCode::kNotFound;
}

// Calls `connect`, and then `once` with the returned client. Repeats both calls after an error if another attempt may
// succeed, until `end` or until all kPauses are used.
template <typename Once>
auto Repeat(const ConnectToShare& connect, proto::ShareRequest& request, const Clock::time_point& end, Once once)
    -> decltype(once(std::declval<Client&>())) {
  const auto* pause = std::begin(kPauses);
  while (true) {
    const Result<Client*> client = connect(request);
    auto done = client ? once(**client) : tl::unexpected(client.error());
    const bool is_last = pause == std::end(kPauses) || Clock::now() >= end;
    if (done || !IsWorthAnother(done.error()) || is_last) return done;
    std::this_thread::sleep_for(*pause++);
  }
}

Result<proto::ShareProgress> FollowOrder(Client& client, const proto::ShareRequest& request, Clock::time_point& end,
                                         const Client::ShareOptions& options) {
  const auto reply = client.Share(request);
  if (!reply) return tl::unexpected(reply.error());
  proto::ShareProgressRequest question;
  question.set_kind(request.kind());
  question.set_order(reply->order());
  while (true) {
    question.set_wait_s(SecondsUntil(end, kReadWaitMax_s));
    auto progress = client.ShareProgress(question);
    if (!progress) return progress;
    options.on_progress(*progress);
    for (const proto::PairProgress& pair : progress->pairs()) {
      if (options.lease_margin <= Client::Duration(0) || pair.waits_for_s() <= 0 || pair.is_stopped()) continue;
      const auto left = std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(pair.waits_for_s()));
      end = std::max(end, Clock::now() + left + options.lease_margin);
    }
    if (progress->is_over() || Clock::now() >= end) return progress;
    question.set_after_version(progress->version());
  }
}

Result<proto::ShareProgress> ShareOnce(Client& client, proto::ShareRequest request, Clock::time_point& end,
                                       const Client::ShareOptions& options) {
  if (options.on_progress) return FollowOrder(client, request, end, options);
  request.set_wait_s(std::max(SecondsUntil(end, kOrderWaitMax_s), 0.001));
  return client.Share(request).map([](proto::ShareReply&& reply) { return std::move(*reply.mutable_progress()); });
}

}  // namespace

Result<proto::ShareProgress> ShareUntilDone(const ConnectToShare& connect, proto::ShareRequest request,
                                            const Client::ShareOptions& options) {
  Clock::time_point end = Clock::now() + options.limit;
  return Repeat(connect, request, end, [&](Client& client) { return ShareOnce(client, request, end, options); });
}

Result<proto::ShareReply> ShareAtOnce(const ConnectToShare& connect, proto::ShareRequest request) {
  const Clock::time_point never = Clock::time_point::max();
  return Repeat(connect, request, never, [&](Client& client) { return client.Share(request); });
}

Result<proto::RoleShowReply> ChangeRolesUntilDone(Client& client, proto::RoleSetRequest request,
                                                  const proto::RoleAssignment& standing, Client::Duration limit,
                                                  bool is_waiting) {
  const Clock::time_point end = Clock::now() + limit;
  *request.mutable_expected()->mutable_term() = standing.term();
  request.mutable_expected()->set_leader(standing.leader());
  request.mutable_expected()->set_survivor(standing.survivor());
  const auto wanted = [](AgentId named, AgentId stands) { return named != 0 ? named : stands; };
  const AgentId leader = request.is_swap() ? standing.survivor() : wanted(request.leader(), standing.leader());
  const AgentId survivor = request.is_swap() ? standing.leader() : wanted(request.survivor(), standing.survivor());
  bool is_unanswered = false;
  while (true) {
    request.set_wait_s(is_waiting && !request.is_dry_run() ? SecondsUntil(end, kOrderWaitMax_s) : 0);
    auto shown = client.SetRoles(request);
    if (shown) return shown;
    const Error error = shown.error();
    const bool is_lost = error.code == ErrorCode::kTimedOut || error.code == ErrorCode::kUnavailable;
    if (error.field != kExpected && !is_lost) return shown;
    is_unanswered = is_unanswered || is_lost;
    auto held = client.Roles();
    const bool is_done = held && is_unanswered && held->roles().leader() == leader &&
                         held->roles().survivor() == survivor && IsNewer(held->roles().term(), standing.term());
    if (is_done) {  // An earlier request succeeded, but its reply was lost.
      if (!is_waiting) return held;
      AddNotConfirmed(*held);
      if (held->not_confirmed_by().empty() || Clock::now() >= end) return held;
    } else if (error.field == kExpected) {
      // The agent may not have received the current roles yet. Try again in that case.
      const bool is_behind = held && IsNewer(standing.term(), held->roles().term());
      if (!is_behind || Clock::now() >= end) return Fail(error.code, error.text);
    } else if (Clock::now() >= end) {
      return Fail(error.code, error.text + "; the roles may or may not have changed: run moonctl role show");
    }
    std::this_thread::sleep_for(kRolesPeriod);
  }
}

// --- Members of Client ---

Result<proto::ShareProgress> Client::Sync(const ShareOptions& options) {
  return ShareFromHere(proto::SHARING_KIND_SYNC, options);
}

Result<proto::ShareProgress> Client::Replicate(const ShareOptions& options) {
  return ShareFromHere(proto::SHARING_KIND_REPLICATION, options);
}

Result<proto::ShareProgress> Client::ShareFromHere(proto::SharingKind kind, const ShareOptions& options) {
  proto::ShareRequest request;
  request.set_kind(kind);
  request.set_destination(options.destination);
  *request.mutable_from_agents() = {options.from.begin(), options.from.end()};
  request.set_bytes_max(options.bytes_max);
  bool was_leading = false;
  const ConnectToShare connect = [this, &was_leading](proto::ShareRequest& given) -> Result<Client*> {
    const auto status = Status();
    if (!status) return tl::unexpected(status.error());
    const bool is_leading = status->roles().leader() == status->agent_id();
    if (was_leading && !is_leading) {
      // Without the lead, this agent would share only its own records.
      return Fail(ErrorCode::kRefused,
                  agent_name_ + " is no longer the leader: send the command to the current leader");
    }
    was_leading = is_leading;
    if (given.destination() == 0) *given.mutable_expected_term() = status->roles().term();
    return this;
  };
  return ShareUntilDone(connect, std::move(request), options);
}

Result<proto::RoleShowReply> Client::SwapRoles(Duration limit) {
  proto::RoleSetRequest request;
  request.set_is_swap(true);
  return SetRoles(std::move(request), limit);
}

Result<proto::RoleShowReply> Client::SetRoles(proto::RoleSetRequest request, Duration limit) {
  const auto standing = Roles();
  if (!standing) return tl::unexpected(standing.error());
  return ChangeRolesUntilDone(*this, std::move(request), standing->roles(), limit);
}

}  // namespace moondb
