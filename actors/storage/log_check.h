// FindLogDamage checks the write-ahead log of a store for damage, before SQLite opens the store.
//
// SQLite reads a log up to the first frame with a wrong checksum and silently discards the remaining frames. After a
// power cut during a write, this is correct. However, each transaction of records is synced to the disk before the next
// transaction begins. If another transaction follows the wrong frame, a power cut cannot be the cause: bits of the log
// were changed, and durable records are lost.
//
// Damage in the last transaction looks like an interrupted write and is not reported. Transactions that are not synced
// one by one (the log of what peers have, the count of bytes written) may be reported as damaged after a power cut. No
// record is lost in this case.
//
// The format is documented at https://sqlite.org/fileformat2.html#walformat.
#pragma once

#include <string>

namespace moondb {

// Returns a sentence that describes the damage, or an empty string if there is no damage or no log. Reads the whole
// log, at some hundreds of MB per second. Requires: no process has the database open.
std::string FindLogDamage(const std::string& database_path);

}  // namespace moondb
