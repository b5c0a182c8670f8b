// JsonString: writes text as a JSON string. Thread-safe.
#pragma once

#include <string>
#include <string_view>

namespace moondb {

// Returns `text` in quotes, on one line. Quotes, backslashes and control characters are escaped. Bytes that are not
// UTF-8 become U+FFFD.
std::string JsonString(std::string_view text);

}  // namespace moondb
