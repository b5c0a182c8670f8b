// Calls that order sharing or a change of roles, and that wait until the agent reports completion.
//
// If the agent restarts, or its roles change, a request to share is repeated up to five times, after pauses of 0.1 to 3
// s.
#pragma once

#include <functional>

#include "client/client.h"

namespace moondb {

// Called before each attempt to send `request`. Returns the client that sends the request. May set
// request.expected_term to the current term.
using ConnectToShare = std::function<Result<Client*>(proto::ShareRequest& request)>;

// Gives an order to share, and waits until the order is over or options.limit has passed. If ShareProgress.is_complete,
// all records are acknowledged. Otherwise each PairProgress (one sender and one destination) reports what is missing,
// or why the pair took no part. If ShareProgress.is_over is false, the order is still in progress. Fails like
// Client::Share, and with kRefused and the field expected_term if the roles change before every attempt.
Result<proto::ShareProgress> ShareUntilDone(const ConnectToShare& connect, proto::ShareRequest request,
                                            const Client::ShareOptions& options);

// Gives an order to share, and returns without waiting for its completion.
Result<proto::ShareReply> ShareAtOnce(const ConnectToShare& connect, proto::ShareRequest request);

// Changes the roles. `standing` is the current assignment as the agent reported it. Waits at most `limit` until the
// change is confirmed: the new leader acts in a term that the new leader issued, and the new survivor has stored the
// assignment of that term. After `limit`, RoleShowReply.not_confirmed_by names those of the two that have not
// confirmed. If `is_waiting` is false, waits only until the agent has stored the assignment. Repeats the request if a
// reply is lost; this does not change the roles twice. Fails with kRefused if `standing` is no longer the current
// assignment. Fails with kTimedOut or kUnavailable if no reply arrived; the roles may have changed in that case.
Result<proto::RoleShowReply> ChangeRolesUntilDone(Client& client, proto::RoleSetRequest request,
                                                  const proto::RoleAssignment& standing, Client::Duration limit,
                                                  bool is_waiting = true);

}  // namespace moondb
