// CSV fields, quoted by the rules of RFC 4180. Thread-safe.
#pragma once

#include <string>
#include <string_view>

namespace moondb {

// Returns `text` as one CSV field. Quotes it if it has a comma, a quote or a line break, or if it is empty. The quotes
// distinguish an empty text from a field without a value.
std::string CsvField(std::string_view text);

}  // namespace moondb
