// Text as JSON has it. Pure function, any thread.
#pragma once

#include <string>
#include <string_view>

namespace moondb {

// In quotes, on one line: quotes, backslashes and control characters are escaped; bytes that are not UTF-8 become
// U+FFFD.
std::string JsonString(std::string_view text);

}  // namespace moondb
