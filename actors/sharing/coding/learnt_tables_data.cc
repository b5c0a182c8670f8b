#include "actors/sharing/coding/learnt_tables.h"

namespace moondb {

const std::string_view kLearntTables = "";

}  // namespace moondb
