// Requests to share and to change roles that end when they are done, as the agent says that carries them out.
//
// Where that agent restarts, or no longer acts on the roles that it acted on, the request is given again: at most five
// times more, with a pause that grows to 3 s before each.
#pragma once

#include <functional>

#include "client/client.h"

namespace moondb {

// The agent that is to take the request, each time that it is given. It may fill in the request what stands there:
// ShareRequest.expected_term.
using ConnectToShare = std::function<Result<Client*>(proto::ShareRequest& request)>;

// ShareProgress.is_complete: all is acknowledged. Else each pair says what is missing, or why it took no part; where
// is_over is not set either, the limit came first, and the order still stands. Errors: as of Client::Share; kRefused
// with the field expected_term where the roles do not come to rest.
Result<proto::ShareProgress> ShareUntilDone(const ConnectToShare& connect, proto::ShareRequest request,
                                            const Client::ShareOptions& options);

// The same without the wait: the order alone.
Result<proto::ShareReply> ShareAtOnce(const ConnectToShare& connect, proto::ShareRequest request);

// Changes the roles that stand (`standing`, as the agent said) and waits until the new leader acts in a term of its own
// and the new survivor has stored it; RoleShowReply.not_confirmed_by names who has not within the limit. Where an
// answer is lost the request is given again: it is neither done twice nor undone. kRefused where another change came
// first; kTimedOut where whether the roles have changed is not known. `is_waiting` false: the answer comes when the
// agent has stored the assignment.
Result<proto::RoleShowReply> ChangeRolesUntilDone(Client& client, proto::RoleSetRequest request,
                                                  const proto::RoleAssignment& standing, Client::Duration limit,
                                                  bool is_waiting = true);

}  // namespace moondb
