#include "model/team_id.h"

#include <sys/random.h>

#include <array>
#include <cerrno>
#include <cstring>

namespace moondb {
namespace {

constexpr std::size_t kShownBytes = 4;
constexpr std::string_view kDigits = "0123456789abcdef";

std::string HexOf(std::string_view bytes) {
  std::string text;
  for (const char byte : bytes) {
    text += kDigits[static_cast<unsigned char>(byte) >> 4];
    text += kDigits[static_cast<unsigned char>(byte) & 0xF];
  }
  return text;
}

}  // namespace

bool IsTeamId(std::string_view text) {
  return text.size() == kTeamIdDigits && text.find_first_not_of(kDigits) == std::string_view::npos;
}

Result<std::string> MakeTeamId() {
  std::array<char, kTeamIdBytes> bytes{};
  // getrandom never returns only a part of so few bytes. A signal can interrupt the call only before the kernel's
  // random generator is initialised.
  ssize_t count = 0;
  do {
    count = ::getrandom(bytes.data(), bytes.size(), 0);
  } while (count < 0 && errno == EINTR);
  if (count == static_cast<ssize_t>(bytes.size())) return HexOf({bytes.data(), bytes.size()});
  return Fail(ErrorCode::kInternal, std::string("the system gives no random bytes: ") + std::strerror(errno));
}

std::string TeamIdBytes(std::string_view team_id) {
  if (!IsTeamId(team_id)) return "";
  std::string bytes;
  for (std::size_t i = 0; i < team_id.size(); i += 2) {
    bytes += static_cast<char>(kDigits.find(team_id[i]) << 4 | kDigits.find(team_id[i + 1]));
  }
  return bytes;
}

std::string TeamIdStart(std::string_view bytes) { return bytes.empty() ? "none" : HexOf(bytes.substr(0, kShownBytes)); }

}  // namespace moondb
