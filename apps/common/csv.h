// CSV for spreadsheets and scripts, quoted as RFC 4180 has it. Pure.
#pragma once

#include <string>
#include <string_view>

namespace moondb {

// One field that holds `text`: in quotes where it has a comma, a quote or a line's end, and where it is empty, so that
// an empty text differs from a field without anything, which has no value.
std::string CsvField(std::string_view text);

}  // namespace moondb
