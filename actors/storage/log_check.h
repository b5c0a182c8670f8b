// Whether the write-ahead log of a store is damaged, before SQLite opens it.
//
// SQLite reads a log up to the first frame whose checksum is wrong and silently discards the rest: it takes it for a
// write that a power cut interrupted. But a transaction of records is on the disk before the next one begins. So if a
// wrong frame's transaction is followed by another one, bits of the log were changed, and records that were
// acknowledged are lost. Wrong bits in the last transaction cannot be told from an interrupted write. After a power cut
// the report may be about notes that are not synced one by one (what peers have, bytes written), of which nothing is
// lost for good.
//
// The format is that of https://sqlite.org/fileformat2.html#walformat.
#pragma once

#include <string>

namespace moondb {

// A sentence for people; empty: no damage was found, or there is no log. Reads the whole log, some hundred MB a second.
// Call it while no process has the database open.
std::string FindLogDamage(const std::string& database_path);

}  // namespace moondb
