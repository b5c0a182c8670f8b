// FindLogDamage tells whether the write-ahead log of a store is damaged, before SQLite opens it.
//
// SQLite reads a log up to the first frame with a wrong checksum and silently discards the rest, as it must after a
// power cut in the middle of a write. But a transaction of records is on the disk before the next one begins. So if
// another transaction follows that of the wrong frame, bits of the log were changed, and records that were stored for
// good are gone. Wrong bits in the last transaction look like an interrupted write, and are not reported. After a power
// cut the report may concern notes that are not synced one by one (what peers have, bytes written); no record is lost
// then.
//
// The format is that of https://sqlite.org/fileformat2.html#walformat.
#pragma once

#include <string>

namespace moondb {

// A sentence for people; empty: no damage was found, or there is no log. Reads the whole log, some hundred MB a second.
// Call it while no process has the database open.
std::string FindLogDamage(const std::string& database_path);

}  // namespace moondb
