#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/user_folder.h"
#include "apps/moonctl/written_files.h"
#include "model/did_you_mean.h"
#include "model/file_writing.h"
#include "model/private_folder.h"
#include "model/rights_name.h"
#include "model/text.h"
#include "runtime/team/client_list.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/new_files.h"
#include "runtime/team/team_check.h"

namespace moondb {
namespace {

constexpr char kHead[] =
    "# Clients that agents admit at their client_address, and their rights: view reads, share also inserts, shares and "
    "solves,\n"
    "# command may do everything. Agents reload this file when it changes; `moonctl clients` edits it.\n";

struct ClientsArguments {
  std::string file;  // Path of the client list. Empty: clients.yaml beside the team file.
  std::string name;
  std::string rights;
  std::string public_key_file;  // Public key of the client. Empty: make a new key pair.
  std::string out;              // File for the new secret key. Empty: NAME.sec in the user's folder.
  bool is_replacing = false;
};

std::filesystem::path FileOf(const CommandContext& context, const ClientsArguments& arguments) {
  return arguments.file.empty() ? context.TeamPath().parent_path() / kClientsFile
                                : std::filesystem::path(arguments.file);
}

Result<std::filesystem::path> ListFile(CommandContext& context, const ClientsArguments& arguments) {
  if (!arguments.file.empty() || !context.TeamPath().empty()) return FileOf(context, arguments);
  return Fail(ErrorCode::kInvalid, "which team? Give -t team.yaml, set MOONDB_TEAM, or give --file clients.yaml");
}

// Reads the client list. Returns an empty list if the file is missing.
Result<proto::ClientList> Read(const std::filesystem::path& file) {
  auto list = ReadClientList(file);
  if (!list && list.error().code == ErrorCode::kNotFound) return proto::ClientList();
  return list;
}

// While this object exists, other moonctl processes cannot change files in this folder.
class FolderLock {
 public:
  static Result<FolderLock> Take(const std::filesystem::path& folder) {
    const std::string path = folder.empty() ? "." : folder.string();
    FolderLock lock(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    int failed = lock.folder_ < 0 ? -1 : ::flock(lock.folder_, LOCK_EX);
    while (failed != 0 && lock.folder_ >= 0 && errno == EINTR) failed = ::flock(lock.folder_, LOCK_EX);
    if (failed != 0) return Fail(ErrorCode::kInternal, std::string("cannot be locked: ") + std::strerror(errno), path);
    return lock;
  }
  FolderLock(FolderLock&& other) noexcept : folder_(std::exchange(other.folder_, -1)) {}
  FolderLock& operator=(FolderLock&& other) = delete;
  ~FolderLock() {
    if (folder_ >= 0) ::close(folder_);
  }

 private:
  explicit FolderLock(int folder) : folder_(folder) {}
  int folder_;
};

// A client list that is being changed, with the lock of its folder.
struct ListEdit {
  FolderLock lock;
  std::filesystem::path file;
  std::string head;  // The comments at the top of the file, which the edit keeps.
  proto::ClientList list;
};

// Returns the comments at the top of the file, or kHead if the file cannot be read. Returns kRefused if there are
// comments elsewhere, because writing the list would lose them.
Result<std::string> HeadOf(const std::filesystem::path& file) {
  const auto text = ReadTextFile(file);
  if (!text) return kHead;
  std::string head;
  std::string_view rest = *text;
  std::size_t number = 1;
  for (; rest.starts_with("#"); ++number) head += std::string(TakeLine(rest)) + "\n";
  for (; !rest.empty(); ++number) {
    const std::string_view line = TakeLine(rest);
    // In YAML, a '#' begins a comment only at the start of a line or after a blank. A key may contain '#', but no
    // blank.
    if (!line.starts_with("#") && line.find(" #") == line.npos && line.find("\t#") == line.npos) continue;
    return Fail(ErrorCode::kRefused,
                "this comment would be lost: move it to the top of the file, or edit the file by hand",
                FileLine(file.string(), number));
  }
  return head;
}

Result<ListEdit> BeginEdit(CommandContext& context, const ClientsArguments& arguments) {
  auto file = ListFile(context, arguments);
  if (!file) return tl::unexpected(file.error());
  auto lock = FolderLock::Take(file->parent_path());
  if (!lock) return tl::unexpected(lock.error());
  auto list = Read(*file);
  if (!list) return tl::unexpected(list.error());
  auto head = HeadOf(*file);
  if (!head) return tl::unexpected(head.error());
  return ListEdit{*std::move(lock), *std::move(file), *std::move(head), *std::move(list)};
}

// Returns the new content of the file. If the agents' parser would reject the new content, returns the parser's error.
Result<std::string> TextOf(const ListEdit& edit) {
  std::string text = ClientListText(edit.list, edit.head);
  if (auto read = ParseClientList(text, edit.file.string()); !read) return tl::unexpected(read.error());
  return text;
}

// Returns the index of the client in the list. -1: the client is not listed.
int IndexOf(const proto::ClientList& list, const std::string& name) {
  for (int i = 0; i < list.clients_size(); ++i) {
    if (list.clients(i).name() == name) return i;
  }
  return -1;
}

Result<proto::ClientRights> ParseRights(const std::string& name) {
  std::vector<std::string> names;
  for (const proto::ClientRights rights :
       {proto::CLIENT_RIGHTS_VIEW, proto::CLIENT_RIGHTS_SHARE, proto::CLIENT_RIGHTS_COMMAND}) {
    names.push_back(RightsName(rights));
    if (names.back() == name) return rights;
  }
  return Fail(ErrorCode::kInvalid, "expected view, share or command, got \"" + name + "\"" + DidYouMean(name, names),
              "--rights");
}

// Returns the client's public key. If no key file was given, makes a new key pair and adds the secret key to `files`,
// which the caller publishes before it writes the client list.
Result<std::string> PublicKey(const ClientsArguments& arguments, const std::filesystem::path& secret_file,
                              NewFiles& files) {
  if (!arguments.public_key_file.empty()) return ReadPublicKey(arguments.public_key_file);
  const auto keys = MakeCurveKeys();
  if (!keys) return tl::unexpected(keys.error());
  if (auto added = files.Add(secret_file, keys->secret_key + "\n", 0600); !added) return tl::unexpected(added.error());
  return keys->public_key;
}

// Returns the path for the new secret key: `out`, or NAME.sec in the user's folder if `out` is empty. The default is
// not beside the team file, because files there are copied to robots. Returns `out`, even if empty, if no key is made.
Result<std::filesystem::path> SecretFile(const ClientsArguments& arguments) {
  if (!arguments.public_key_file.empty() || !arguments.out.empty()) return std::filesystem::path(arguments.out);
  auto folder = UserFolder();
  if (!folder) return folder;
  if (const auto made = MakePrivateFolder(*folder); !made) return tl::unexpected(made.error());
  return *folder / (arguments.name + ".sec");
}

// Agents may run as another user and have to read the list, which holds no secret.
Result<void> WriteList(const std::filesystem::path& file, const std::string& text) {
  std::error_code failure;
  if (std::filesystem::exists(file, failure)) return ReplaceFile(file, text);
  return WriteWholeFile(file, text, {.mode = 0644, .is_synced = true});
}

ExitCode AddClient(CommandContext& context, const ClientsArguments& arguments) {
  auto edit = BeginEdit(context, arguments);
  if (!edit) return context.Report(edit.error());
  const auto rights = ParseRights(arguments.rights);
  if (!rights) return context.Report(rights.error());
  if (!IsPlainName(arguments.name)) {
    return context.Report({ErrorCode::kInvalid, kPlainNameRule + Quoted(arguments.name), "NAME"});
  }
  const int index = IndexOf(edit->list, arguments.name);
  if (index >= 0 && !arguments.is_replacing) {
    return context.Report(
        {ErrorCode::kRefused, arguments.name + " is already listed; give --replace to replace its key", {}});
  }
  const auto secret_file = SecretFile(arguments);
  if (!secret_file) return context.Report(secret_file.error());
  NewFiles files;
  const auto key = PublicKey(arguments, *secret_file, files);
  if (!key) return context.Report(key.error());
  proto::ListedClient& client = index >= 0 ? *edit->list.mutable_clients(index) : *edit->list.add_clients();
  client.set_name(arguments.name);
  client.set_key(*key);
  client.set_rights(*rights);
  const auto text = TextOf(*edit);
  if (!text) return context.Report(text.error());
  const bool is_made = arguments.public_key_file.empty();
  // Publish the secret key before the list, so that the list never names a client whose secret key was lost.
  if (auto published = files.Publish(); !published) return context.Report(published.error());
  if (auto written = WriteList(edit->file, *text); !written) {
    std::error_code ignored;
    if (is_made) std::filesystem::remove(*secret_file, ignored);
    return context.Report(written.error());
  }

  JsonWriter json;
  json.BeginObject().Key("name").String(arguments.name).Key("rights").String(arguments.rights);
  json.Key("key").String(*key).Key("secret_file").String(is_made ? secret_file->string() : "").EndObject();
  std::string shown =
      arguments.name + " has the rights \"" + arguments.rights + "\" at the agents that use " + edit->file.string();
  if (is_made)
    shown += "\n" + arguments.name + "'s secret key is in " + secret_file->string() + "; use it with moonctl --key";
  return context.Done(json.text(), shown);
}

ExitCode ListClients(CommandContext& context, const ClientsArguments& arguments) {
  const auto file = ListFile(context, arguments);
  if (!file) return context.Report(file.error());
  const auto list = Read(*file);
  if (!list) return context.Report(list.error());
  Table table({"CLIENT", "RIGHTS", "KEY"});
  JsonWriter json;
  json.BeginObject().Key("file").String(file->string()).Key("clients").BeginArray();
  for (const proto::ListedClient& client : list->clients()) {
    const std::string rights = RightsName(client.rights());
    table.Add({client.name(), rights, client.key()});
    json.BeginObject().Key("name").String(client.name()).Key("rights").String(rights);
    json.Key("key").String(client.key()).EndObject();
  }
  json.EndArray().EndObject();
  return context.Done(json.text(), table.Text());
}

ExitCode RevokeClient(CommandContext& context, const ClientsArguments& arguments) {
  auto edit = BeginEdit(context, arguments);
  if (!edit) return context.Report(edit.error());
  const int index = IndexOf(edit->list, arguments.name);
  if (index < 0) {
    std::vector<std::string> names;
    for (const proto::ListedClient& listed : edit->list.clients()) names.push_back(listed.name());
    return context.Report(
        {ErrorCode::kNotFound,
         edit->file.string() + " lists no client \"" + arguments.name + "\"" + DidYouMean(arguments.name, names),
         {}});
  }
  edit->list.mutable_clients()->DeleteSubrange(index, 1);
  const auto text = TextOf(*edit);
  if (!text) return context.Report(text.error());
  if (auto written = WriteList(edit->file, *text); !written) return context.Report(written.error());
  JsonWriter json;
  json.BeginObject().Key("revoked").String(arguments.name).EndObject();
  return context.Done(json.text(),
                      arguments.name + " no longer has rights at the agents that use " + edit->file.string());
}

}  // namespace

void AddClientsCommands(Command& app, CommandContext& context) {
  auto arguments = std::make_shared<ClientsArguments>();
  Command& clients = app.AddSubcommand("clients", "Manage the keys and rights of clients");
  clients.RequireSubcommand();
  const auto command = [&](const char* name, const char* description, const CommandNote& note,
                           auto action) -> Command& {
    Command& added = AddCommand(clients, name, description, note);
    added.AddOption("--file", arguments->file, "Client list (default: clients.yaml beside the team file)")
        .TypeName("FILE");
    added.Callback([&context, arguments, action] {
      context.action = [&context, arguments, action] { return action(context, *arguments); };
    });
    return added;
  };
  Command& add = command("add", "Add a client, with a new key pair or with its own public key",
                         {"moonctl clients add anna --rights command"}, AddClient);
  add.AddOption("name", arguments->name, "Name of the client in the team's event log").Required().TypeName("NAME");
  add.AddOption("--rights", arguments->rights,
                "Rights: view, share (view, insert, share and solve) or command (everything)")
      .Required()
      .TypeName("{view,share,command}");
  Option& public_key = add.AddOption("--public-key", arguments->public_key_file,
                                     "Add the public key in this file instead of creating a key pair")
                           .TypeName("FILE");
  add.AddOption("--out", arguments->out, "File for the new secret key (default: ~/.config/moondb/NAME.sec)")
      .TypeName("FILE")
      .Excludes(public_key);
  add.AddFlag("--replace", arguments->is_replacing, "Replace the client's key; the old one stops working");
  command("list", "List the clients", {"moonctl clients list"}, ListClients);
  Command& revoke = command("revoke", "Revoke a client's key, also for a client that is connected now",
                            {"moonctl clients revoke anna"}, RevokeClient);
  revoke.AddOption("name", arguments->name, "Name of the client").Required().TypeName("NAME");
}

}  // namespace moondb
