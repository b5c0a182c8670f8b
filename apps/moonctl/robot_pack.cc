#include "apps/moonctl/robot_pack.h"

#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "model/team_member.h"
#include "model/text.h"
#include "runtime/team/client_list.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/new_files.h"
#include "runtime/team/signing_key.h"
#include "runtime/team/team_keys.h"

namespace moondb {
namespace {

// First bytes of a pack.
constexpr std::string_view kMagic = "moondb robot pack 1\n";
constexpr std::uint32_t kFormat = 1;

// A file that a pack holds.
struct Content {
  std::string name;
  bool is_secret = false;
  bool is_optional = false;
};

// Returns the files of an agent, with their names beside the team file.
std::vector<Content> ContentsOf(const proto::TeamConfig& team, const std::string& agent) {
  std::vector<Content> contents{{kPackedTeamFile}, {kClientsFile, false, true}, {agent + ".env", false, true}};
  for (const proto::AgentConfig& member : team.agents()) {
    if (!member.key().empty()) contents.push_back({member.key()});
    if (member.name() != agent || member.key().empty()) continue;
    const std::filesystem::path secret = SecretKeyPath(member.key());
    contents.push_back({secret.string(), true});
    contents.push_back({SigningSecretPath(secret).string(), true});
  }
  return contents;
}

// Returns kInvalid unless all key files lie beside the team file.
Result<void> CheckNames(const std::vector<Content>& contents) {
  for (const Content& content : contents) {
    if (std::filesystem::path(content.name).filename() == content.name && content.name != "..") continue;
    return Fail(ErrorCode::kInvalid, content.name + ": a pack holds only key files that lie beside the team file");
  }
  return {};
}

std::string ContentOf(const proto::RobotPack& pack, std::string_view name) {
  for (const proto::PackedFile& file : pack.files()) {
    if (file.name() == name) return file.content();
  }
  return "";
}

// Returns the owner of new files in `folder`, if this process may set it.
std::optional<FileOwner> OwnerOfFilesIn(const std::filesystem::path& folder) {
  struct stat status {};
  if (::geteuid() != 0 || ::stat(folder.c_str(), &status) != 0) return std::nullopt;
  return FileOwner{status.st_uid, status.st_gid};
}

Result<void> MakeFolder(const std::filesystem::path& folder) {
  std::error_code failure;
  if (std::filesystem::is_directory(folder, failure)) return {};
  std::filesystem::create_directories(folder, failure);
  if (failure) return Fail(ErrorCode::kInternal, "the folder cannot be made: " + failure.message(), folder.string());
  std::filesystem::permissions(folder, std::filesystem::perms(0750), failure);
  const passwd* user = ::geteuid() == 0 ? ::getpwnam("moondb") : nullptr;
  if (user != nullptr) (void)!::chown(folder.c_str(), user->pw_uid, user->pw_gid);
  return {};
}

}  // namespace

Result<proto::RobotPack> PackRobot(const TeamFile& team, const std::filesystem::path& team_file,
                                   const std::string& agent, const std::string& options) {
  const proto::AgentConfig& self = *FindAgent(team.config, agent);
  if (!team.config.insecure()) {
    const auto keys = ReadTeamKeys(team.config, team.folder, self.id(), "");
    if (!keys) return tl::unexpected(keys.error());
    const auto signing = ReadSigningKey(team.config, team.folder, self.id(), "");
    if (!signing) return tl::unexpected(signing.error());
  }
  const std::vector<Content> contents = ContentsOf(team.config, agent);
  if (const auto checked = CheckNames(contents); !checked) return tl::unexpected(checked.error());
  proto::RobotPack pack;
  pack.set_format(kFormat);
  pack.set_agent(agent);
  for (const Content& content : contents) {
    const std::filesystem::path path = content.name == kPackedTeamFile ? team_file : team.folder / content.name;
    std::string text;
    if (content.name == agent + ".env") {
      if (options.empty()) continue;
      text = "AGENT_OPTIONS=" + options + "\n";
    } else {
      std::error_code failure;
      if (content.is_optional && !std::filesystem::exists(path, failure)) continue;
      auto read = ReadTextFile(path);
      if (!read) return tl::unexpected(read.error());
      text = *std::move(read);
    }
    proto::PackedFile& file = *pack.add_files();
    file.set_name(content.name);
    file.set_content(std::move(text));
    file.set_is_secret(content.is_secret);
  }
  return pack;
}

std::string SerializeRobotPack(const proto::RobotPack& pack) { return std::string(kMagic) + pack.SerializeAsString(); }

Result<proto::RobotPack> ParseRobotPack(const std::string& bytes) {
  proto::RobotPack pack;
  if (!bytes.starts_with(kMagic) || !pack.ParseFromString(bytes.substr(kMagic.size())) || pack.format() != kFormat) {
    return Fail(ErrorCode::kCorrupt, "it is no pack of `moonctl config pack`, or damaged");
  }
  const auto team = ParseTeamFile(ContentOf(pack, kPackedTeamFile), kPackedTeamFile);
  if (!team) return tl::unexpected(team.error());
  if (FindAgent(team->config, pack.agent()) == nullptr) {
    return Fail(ErrorCode::kInvalid, "its team file has no agent " + OneLine(pack.agent()));
  }
  const std::vector<Content> contents = ContentsOf(team->config, pack.agent());
  if (const auto checked = CheckNames(contents); !checked) return tl::unexpected(checked.error());
  std::set<std::string> seen;
  for (const proto::PackedFile& file : pack.files()) {
    const auto known = std::find_if(contents.begin(), contents.end(), [&](const Content& content) {
      return content.name == file.name() && content.is_secret == file.is_secret();
    });
    if (known == contents.end() || !seen.insert(file.name()).second) {
      return Fail(ErrorCode::kInvalid, "the file " + OneLine(file.name()) + " does not belong into this pack");
    }
  }
  for (const Content& content : contents) {
    if (!content.is_optional && !seen.contains(content.name)) {
      return Fail(ErrorCode::kInvalid, "it lacks the file " + content.name);
    }
  }
  return pack;
}

Result<std::vector<std::string>> UnpackRobot(const proto::RobotPack& pack, const std::filesystem::path& folder) {
  if (const auto made = MakeFolder(folder); !made) return tl::unexpected(made.error());
  std::vector<const proto::PackedFile*> changed;
  for (const proto::PackedFile& file : pack.files()) {
    const std::filesystem::path path = folder / file.name();
    std::error_code failure;
    if (std::filesystem::exists(path, failure)) {
      const auto present = ReadTextFile(path);
      if (present && *present == file.content()) continue;
      if (file.is_secret()) {
        return Fail(ErrorCode::kRefused, path.string() + " holds another key of " + pack.agent() +
                                             "; if the new one is right, remove it and unpack again");
      }
    }
    changed.push_back(&file);
  }
  const std::optional<FileOwner> owner = OwnerOfFilesIn(folder);
  const auto aside_of = [&](const proto::PackedFile& file) { return folder / (file.name() + ".new"); };
  std::error_code failure;
  Result<void> written;
  for (const proto::PackedFile* file : changed) {
    std::filesystem::remove(aside_of(*file), failure);  // An unpacking that was killed may have left it.
    if (written) written = WriteNewFile(aside_of(*file), file->content(), file->is_secret() ? 0600 : 0644, owner);
  }
  if (!written) {
    for (const proto::PackedFile* file : changed) std::filesystem::remove(aside_of(*file), failure);
    return tl::unexpected(written.error());
  }
  // The team file comes last: it must never name a key that is not there.
  std::stable_partition(changed.begin(), changed.end(),
                        [](const proto::PackedFile* file) { return file->name() != kPackedTeamFile; });
  std::vector<std::string> names;
  for (const proto::PackedFile* file : changed) {
    std::filesystem::rename(aside_of(*file), folder / file->name(), failure);
    if (failure) return Fail(ErrorCode::kInternal, failure.message(), (folder / file->name()).string());
    names.push_back(file->name());
  }
  return names;
}

}  // namespace moondb
