#include "apps/moonctl/robot_pack.h"

#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>
#include <xxhash.h>

#include <algorithm>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "apps/moonctl/packed_files.h"
#include "model/file_writing.h"
#include "model/team_member.h"
#include "model/text.h"
#include "runtime/team/new_files.h"
#include "runtime/team/team_keys.h"

namespace moondb {
namespace {

// First bytes of a pack. The version follows, then the hash of the rest (8 bytes, lowest first), then the message.
constexpr std::string_view kMagic = "moondb robot pack ";
constexpr std::string_view kVersion = "2\n";
constexpr std::uint32_t kFormat = 2;
constexpr std::size_t kHashBytes = 8;

std::string HashOf(std::string_view message) {
  const std::uint64_t hash = XXH64(message.data(), message.size(), 0);
  std::string bytes;
  for (std::size_t i = 0; i < kHashBytes; ++i) bytes += static_cast<char>(hash >> (8 * i));
  return bytes;
}

// Parses the bytes of a pack up to its files. Does not check the files.
Result<proto::RobotPack> ParseMessage(std::string_view bytes) {
  const auto damaged = [] {
    return Fail(ErrorCode::kCorrupt, "not a pack written by `moonctl config pack`, or damaged");
  };
  if (!bytes.starts_with(kMagic)) return damaged();
  bytes.remove_prefix(kMagic.size());
  if (!bytes.starts_with(kVersion)) {
    return Fail(
        ErrorCode::kInvalid,
        "this pack was made by another version of moondb; make it again with `moonctl config pack` of this version");
  }
  bytes.remove_prefix(kVersion.size());
  if (bytes.size() < kHashBytes || HashOf(bytes.substr(kHashBytes)) != bytes.substr(0, kHashBytes)) return damaged();
  bytes.remove_prefix(kHashBytes);
  proto::RobotPack pack;
  if (!pack.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())) || pack.format() != kFormat) return damaged();
  return pack;
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
  failure = folder.has_parent_path() ? MakeFolders(folder.parent_path(), 0755) : std::error_code();
  if (!failure) failure = MakeFolders(folder, 0750);
  if (failure) return Fail(ErrorCode::kInternal, "the folder cannot be made: " + failure.message(), folder.string());
  const passwd* user = ::geteuid() == 0 ? ::getpwnam("moondb") : nullptr;
  if (user != nullptr) (void)!::lchown(folder.c_str(), user->pw_uid, user->pw_gid);
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
  const auto names = PackedNames(team.config, agent);
  if (!names) return tl::unexpected(names.error());
  proto::RobotPack pack;
  pack.set_format(kFormat);
  pack.set_agent(agent);
  for (const PackedName& content : *names) {
    const std::filesystem::path path = content.name == kPackedTeamFile ? team_file : team.folder / content.name;
    std::string text;
    if (content.name == agent + ".env") {
      if (options.empty()) continue;
      auto line = OptionsFile(options);
      if (!line) return tl::unexpected(line.error());
      text = *std::move(line);
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
  if (const auto checked = CheckPackedContents(pack, team.config); !checked) return tl::unexpected(checked.error());
  return pack;
}

std::string SerializeRobotPack(const proto::RobotPack& pack) {
  const std::string message = pack.SerializeAsString();
  return std::string(kMagic) + std::string(kVersion) + HashOf(message) + message;
}

Result<proto::RobotPack> ParseRobotPack(const std::string& bytes) {
  auto pack = ParseMessage(bytes);
  if (!pack) return pack;
  const auto team = ParseTeamFile(ContentOf(*pack, kPackedTeamFile), kPackedTeamFile);
  if (!team) return tl::unexpected(team.error());
  if (FindAgent(team->config, pack->agent()) == nullptr) {
    return Fail(ErrorCode::kInvalid, "the team file in the pack has no agent " + OneLine(pack->agent()));
  }
  const auto names = PackedNames(team->config, pack->agent());
  if (!names) return tl::unexpected(names.error());
  std::set<std::string> seen;
  for (const proto::PackedFile& file : pack->files()) {
    const auto known = std::find_if(names->begin(), names->end(), [&](const PackedName& content) {
      return content.name == file.name() && content.is_secret == file.is_secret();
    });
    if (known == names->end() || !seen.insert(file.name()).second) {
      return Fail(ErrorCode::kInvalid, "the file " + OneLine(file.name()) + " does not belong to this pack");
    }
  }
  for (const PackedName& content : *names) {
    if (!content.is_optional && !seen.contains(content.name)) {
      return Fail(ErrorCode::kInvalid, "the pack lacks the file " + content.name);
    }
  }
  if (const auto checked = CheckPackedContents(*pack, team->config); !checked) return tl::unexpected(checked.error());
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
        return Fail(ErrorCode::kRefused, path.string() + " holds a different key of " + pack.agent() +
                                             "; if the key in the pack is right, remove this file and unpack again");
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
