// NotifyService: reports the state of this process to the service manager that started it (systemd, sd_notify(3)).
#pragma once

#include <string_view>

namespace moondb {

// Sends one assignment, such as "READY=1" or "WATCHDOG=1", to the socket that the environment variable NOTIFY_SOCKET
// names. Never blocks. Does nothing without that variable, and logs nothing if the socket is not reachable: the service
// manager then acts on the missing report. Thread-safe.
void NotifyService(std::string_view state);

}  // namespace moondb
