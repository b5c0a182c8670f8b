// Requests to share and to change roles that return when the agent reports completion.
//
// If the agent restarts, or its roles change, the request to share is repeated up to five times, with growing pauses of
// up to 3 s.
#pragma once

#include <functional>

#include "client/client.h"

namespace moondb {

// Returns the client to send the request to; called before each attempt. May set ShareRequest.expected_term to the
// current term.
using ConnectToShare = std::function<Result<Client*>(proto::ShareRequest& request)>;

// Gives an order to share and waits for it. If ShareProgress.is_complete, all records are acknowledged. Otherwise each
// pair says what is missing, or why it took no part. If is_over is false, the limit was reached and the order is still
// in progress. Fails like Client::Share, and with kRefused and the field expected_term if the roles keep changing.
Result<proto::ShareProgress> ShareUntilDone(const ConnectToShare& connect, proto::ShareRequest request,
                                            const Client::ShareOptions& options);

// Gives an order to share without waiting for it.
Result<proto::ShareReply> ShareAtOnce(const ConnectToShare& connect, proto::ShareRequest request);

// Changes the current roles and waits until the new leader acts in a term of its own and the new survivor has stored
// it. `standing`: the current roles, as reported by the agent. RoleShowReply.not_confirmed_by names those of the two
// that did not confirm within the limit. A request whose reply is lost is repeated; the change is idempotent. Fails
// with kRefused if another change came first, and with kTimedOut if it is unknown whether the roles have changed. If
// `is_waiting` is false, the call returns when the agent has stored the assignment.
Result<proto::RoleShowReply> ChangeRolesUntilDone(Client& client, proto::RoleSetRequest request,
                                                  const proto::RoleAssignment& standing, Client::Duration limit,
                                                  bool is_waiting = true);

}  // namespace moondb
