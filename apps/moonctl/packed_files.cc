#include "apps/moonctl/packed_files.h"

#include <algorithm>
#include <filesystem>
#include <optional>
#include <string_view>

#include "model/team_member.h"
#include "model/text.h"
#include "runtime/team/client_list.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/signing_key.h"

namespace moondb {
namespace {

constexpr std::string_view kOptionsStart = "AGENT_OPTIONS=";
constexpr std::string_view kPublicKeyEnd = ".pub";

bool IsLetterOrDigit(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9'); }

// Returns true if all characters are letters, digits or in `others`.
bool HasOnly(std::string_view text, std::string_view others) {
  return std::all_of(text.begin(), text.end(),
                     [others](char c) { return IsLetterOrDigit(c) || others.find(c) != others.npos; });
}

Result<void> CheckKeyName(const std::string& name) {
  if (std::filesystem::path(name).filename() != name || name == "..") {
    return Fail(ErrorCode::kInvalid, OneLine(name) + ": a pack holds only key files that lie beside the team file");
  }
  if (!name.ends_with(kPublicKeyEnd) || name.starts_with('.') || !HasOnly(name, "-_.")) {
    return Fail(ErrorCode::kInvalid,
                OneLine(name) +
                    ": a pack holds only key files whose names consist of letters, digits, -, _ and ., do not begin "
                    "with . and end in .pub; rename the file and change the team file");
  }
  return {};
}

// Checks the two secret keys of the pack's agent.
Result<void> CheckSecrets(const proto::RobotPack& pack, const proto::AgentConfig& self) {
  const std::filesystem::path secret_path = SecretKeyPath(self.key());
  const auto secret = ParseKeyFile(ContentOf(pack, secret_path), secret_path);
  if (!secret) return tl::unexpected(secret.error());
  const auto public_key = ParseKeyFile(ContentOf(pack, self.key()), self.key());
  if (!public_key) return tl::unexpected(public_key.error());
  if (const auto fitting = PublicKeyOf(*secret); !fitting || *fitting != *public_key) {
    return Fail(ErrorCode::kInvalid, secret_path.string() + ": does not match the public key " + self.key());
  }
  const std::filesystem::path signing_path = SigningSecretPath(secret_path);
  const auto signing = ParseKeyFile(ContentOf(pack, signing_path), signing_path);
  if (!signing) return tl::unexpected(signing.error());
  const std::optional<KeyBytes> seed = FromZ85(*signing);
  if (!seed || SigningKey::FromSeed(*seed).public_key() != self.signing_key()) {
    return Fail(ErrorCode::kInvalid,
                signing_path.string() + ": does not match the signing_key of " + self.name() + " in the team file");
  }
  return {};
}

Result<void> CheckOptions(const std::string& name, const std::string& text) {
  if (text.starts_with(kOptionsStart) && text.ends_with('\n')) {
    const auto made = OptionsFile(text.substr(kOptionsStart.size(), text.size() - kOptionsStart.size() - 1));
    if (made && *made == text) return {};
  }
  return Fail(ErrorCode::kInvalid, name + ": expected the one line AGENT_OPTIONS=... with options of moondb_agent");
}

}  // namespace

std::string ContentOf(const proto::RobotPack& pack, const std::string& name) {
  for (const proto::PackedFile& file : pack.files()) {
    if (file.name() == name) return file.content();
  }
  return "";
}

Result<std::vector<PackedName>> PackedNames(const proto::TeamConfig& team, const std::string& agent) {
  std::vector<PackedName> names{{kPackedTeamFile}, {kClientsFile, false, true}, {agent + ".env", false, true}};
  for (const proto::AgentConfig& member : team.agents()) {
    if (member.key().empty()) continue;
    if (const auto checked = CheckKeyName(member.key()); !checked) return tl::unexpected(checked.error());
    names.push_back({member.key()});
    if (member.name() != agent) continue;
    const std::filesystem::path secret = SecretKeyPath(member.key());
    names.push_back({secret.string(), true});
    names.push_back({SigningSecretPath(secret).string(), true});
  }
  return names;
}

Result<std::string> OptionsFile(const std::string& options) {
  if (!HasOnly(options, " -_.,:/=@+[]")) {
    return Fail(ErrorCode::kInvalid,
                "expected letters, digits, spaces and -_.,:/=@+[] only, got \"" + OneLine(options) + "\"", "--options");
  }
  return std::string(kOptionsStart) + options + "\n";
}

Result<void> CheckPackedContents(const proto::RobotPack& pack, const proto::TeamConfig& team) {
  for (const proto::AgentConfig& member : team.agents()) {
    if (member.key().empty()) continue;
    const auto key = ParseKeyFile(ContentOf(pack, member.key()), member.key());
    if (!key) return tl::unexpected(key.error());
  }
  for (const proto::PackedFile& file : pack.files()) {
    if (file.name() == kClientsFile) {
      if (const auto list = ParseClientList(file.content(), kClientsFile); !list) return tl::unexpected(list.error());
    }
    if (file.name() == pack.agent() + ".env") {
      if (const auto checked = CheckOptions(file.name(), file.content()); !checked) return checked;
    }
  }
  const proto::AgentConfig& self = *FindAgent(team, pack.agent());
  return self.key().empty() ? Result<void>() : CheckSecrets(pack, self);
}

}  // namespace moondb
