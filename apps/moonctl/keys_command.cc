#include <memory>
#include <utility>
#include <vector>

#include "apps/common/json_writer.h"
#include "apps/common/table.h"
#include "apps/moonctl/command.h"
#include "apps/moonctl/commands.h"
#include "apps/moonctl/user_folder.h"
#include "apps/moonctl/written_files.h"
#include "model/private_folder.h"
#include "model/rights_name.h"
#include "model/text.h"
#include "runtime/team/client_list.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/key_fingerprint.h"
#include "runtime/team/team_check.h"
#include "runtime/team/team_init.h"

namespace moondb {
namespace {

struct KeysArguments {
  std::string file;  // Path of the team file. Empty: the file given with -t or in $MOONDB_TEAM.
  std::string name;
  std::string out;  // Folder for new keys. Empty: the folder of the team file for an agent, UserFolder() for a client.
  bool is_client = false;
};

// --- keys new ---

// Returns the folder for an agent's new keys: `out`, otherwise the folder of the team file. The team file need not name
// the agent yet.
Result<std::filesystem::path> AgentKeyFolder(const CommandContext& context, const KeysArguments& arguments) {
  if (!arguments.out.empty()) return std::filesystem::path(arguments.out);
  if (!context.TeamPath().empty()) return context.TeamPath().parent_path();
  return Fail(ErrorCode::kInvalid, "which folder? Give -t team.yaml, set MOONDB_TEAM, or give --out FOLDER");
}

ExitCode MakeAgentKeys(const CommandContext& context, const KeysArguments& arguments) {
  const auto folder = AgentKeyFolder(context, arguments);
  if (!folder) return context.Report(folder.error());
  const std::filesystem::path public_file = *folder / (arguments.name + ".pub");
  const SigningKey signing = SigningKey::Make();
  NewFiles files;
  Result<void> written = AddAgentKeys(public_file, signing, &files);
  if (written) written = files.Publish();
  if (!written) return context.Report(written.error());
  const std::filesystem::path secret_file = SecretKeyPath(public_file);
  JsonWriter json;
  json.BeginObject().Key("name").String(arguments.name).Key("public_file").String(public_file.string());
  json.Key("secret_file").String(secret_file.string());
  json.Key("signing_file").String(SigningSecretPath(secret_file).string());
  json.Key("signing_key").String(signing.public_key()).EndObject();
  return context.Done(
      json.text(), "wrote " + public_file.string() + ", " + secret_file.string() + " and " +
                       SigningSecretPath(secret_file).string() + "; add to the agent in the team file:\n    key: \"" +
                       public_file.filename().string() + "\"\n    signing_key: \"" + signing.public_key() + "\"");
}

ExitCode MakeClientKeys(const CommandContext& context, const KeysArguments& arguments) {
  const auto folder = arguments.out.empty() ? UserFolder() : Result<std::filesystem::path>(arguments.out);
  if (!folder) return context.Report(folder.error());
  if (arguments.out.empty()) {
    if (const auto made = MakePrivateFolder(*folder); !made) return context.Report(made.error());
  }
  const std::filesystem::path public_file = *folder / (arguments.name + ".pub");
  const auto keys = MakeCurveKeys();
  if (!keys) return context.Report(keys.error());
  NewFiles files;
  Result<void> written = files.Add(SecretKeyPath(public_file), keys->secret_key + "\n", 0600);
  if (written) written = files.Add(public_file, keys->public_key + "\n", 0644);
  if (written) written = files.Publish();
  if (!written) return context.Report(written.error());
  JsonWriter json;
  json.BeginObject().Key("name").String(arguments.name).Key("public_file").String(public_file.string());
  json.Key("secret_file").String(SecretKeyPath(public_file).string()).Key("key").String(keys->public_key).EndObject();
  return context.Done(json.text(),
                      arguments.name + "'s secret key is in " + SecretKeyPath(public_file).string() +
                          "; use it with moonctl --key\nnext, where the team's client list is kept, with " +
                          public_file.string() + ": moonctl clients add " + arguments.name +
                          " --rights command --public-key " + public_file.filename().string());
}

ExitCode MakeKeys(CommandContext& context, const KeysArguments& arguments) {
  if (!IsPlainName(arguments.name)) {
    return context.Report({ErrorCode::kInvalid, kPlainNameRule + Quoted(arguments.name), "NAME"});
  }
  return arguments.is_client ? MakeClientKeys(context, arguments) : MakeAgentKeys(context, arguments);
}

// --- keys show ---

// State of a secret key on this machine: present or not, valid or not.
struct SecretHere {
  bool is_here = false;
  std::string wrong;  // Why the key cannot be used. Empty: the key is valid or missing.
};

// Checks whether `file` exists and holds the secret key that belongs to `public_key`. `public_key_of` reads a secret
// key and returns its public key.
template <typename PublicKeyOf>
SecretHere InspectSecret(const std::filesystem::path& file, const std::string& public_key, PublicKeyOf public_key_of) {
  std::error_code error;
  if (!std::filesystem::exists(file, error)) return {false, error ? file.string() + ": " + error.message() : ""};
  const Result<std::string> own = public_key_of(file);
  if (!own) return {true, own.error().text};
  return {true, *own == public_key ? "" : file.string() + ": does not match the public key"};
}

SecretHere CurveSecretHere(const std::filesystem::path& file, const std::string& public_key) {
  return InspectSecret(file, public_key, [](const std::filesystem::path& path) -> Result<std::string> {
    const Result<std::string> secret = ReadSecretKey(path);
    return secret ? PublicKeyOf(*secret) : secret;
  });
}

SecretHere SigningSecretHere(const std::filesystem::path& file, const std::string& public_key) {
  return InspectSecret(file, public_key, [](const std::filesystem::path& path) -> Result<std::string> {
    const Result<SigningKey> key = SigningKey::Read(path);
    if (!key) return tl::unexpected(key.error());
    return key->public_key();
  });
}

// Returns the names of the files that exist ("rover1.sec, rover1.sign"), followed by their faults. Returns "-" if no
// file exists.
std::string SecretsText(const std::vector<std::pair<std::filesystem::path, SecretHere>>& secrets) {
  std::string text;
  for (const auto& [file, secret] : secrets) {
    if (secret.is_here) text += (text.empty() ? "" : ", ") + file.filename().string();
  }
  for (const auto& [file, secret] : secrets) {
    if (!secret.wrong.empty()) text += (text.empty() ? "" : "; ") + secret.wrong;
  }
  return text.empty() ? "-" : text;
}

void WriteSecret(const char* key, const SecretHere& secret, JsonWriter& json) {
  json.Key(key).BeginObject().Key("is_here").Bool(secret.is_here).Key("wrong").String(secret.wrong).EndObject();
}

// Adds one agent to the table and the JSON. Returns true if each of the agent's secret keys on this machine fits its
// public key.
bool AddAgent(const TeamFile& team, const proto::AgentConfig& agent, Table& table, JsonWriter& json) {
  const std::filesystem::path public_file = team.folder / agent.key();
  const std::filesystem::path secret_file = SecretKeyPath(public_file);
  const std::filesystem::path signing_file = SigningSecretPath(secret_file);
  const std::string key = ReadPublicKey(public_file).value_or("");  // Reading the team file has checked this key.
  const SecretHere secret = CurveSecretHere(secret_file, key);
  const SecretHere signing = SigningSecretHere(signing_file, agent.signing_key());
  const bool is_right = secret.wrong.empty() && signing.wrong.empty();
  table.Add({agent.name(), FingerprintOf(key), FingerprintOf(agent.signing_key()),
             SecretsText({{secret_file, secret}, {signing_file, signing}}) + (agent.left() ? " (has left)" : "")},
            is_right ? Tone::kPlain : Tone::kBad);
  json.BeginObject().Key("name").String(agent.name()).Key("has_left").Bool(agent.left());
  json.Key("public_file").String(public_file.string()).Key("fingerprint").String(FingerprintOf(key));
  json.Key("signing_fingerprint").String(FingerprintOf(agent.signing_key()));
  WriteSecret("secret", secret, json);
  WriteSecret("signing_secret", signing, json);
  json.EndObject();
  return is_right;
}

void AddClient(const proto::ListedClient& client, Table& table, JsonWriter& json) {
  const auto folder = UserFolder();
  const std::filesystem::path file = folder ? *folder / (client.name() + ".sec") : std::filesystem::path();
  const SecretHere secret = file.empty() ? SecretHere() : CurveSecretHere(file, client.key());
  // The file may hold the key of a client of another team with the same name. Such a key does not fit and is not shown.
  const bool is_here = secret.is_here && secret.wrong.empty();
  table.Add({client.name(), RightsName(client.rights()), FingerprintOf(client.key()), is_here ? file.string() : "-"});
  json.BeginObject().Key("name").String(client.name()).Key("rights").String(RightsName(client.rights()));
  json.Key("fingerprint").String(FingerprintOf(client.key()));
  json.Key("secret_file").String(is_here ? file.string() : "").EndObject();
}

ExitCode ShowKeys(CommandContext& context) {
  const auto team = context.Team();
  if (!team) return context.Report(team.error());
  if ((*team)->config.insecure()) {
    return context.Report(
        {ErrorCode::kInvalid, context.TeamPath().string() + ": the team has no keys (insecure: true)", {}});
  }
  const auto list = ReadClientList((*team)->folder / kClientsFile);
  if (!list && list.error().code != ErrorCode::kNotFound) return context.Report(list.error());
  const proto::ClientList listed = list.value_or(proto::ClientList());
  Table agents({"AGENT", "KEY", "SIGNING KEY", "SECRETS HERE"});
  Table clients({"CLIENT", "RIGHTS", "KEY", "SECRET HERE"});
  JsonWriter json;
  bool is_right = true;
  json.BeginObject().Key("agents").BeginArray();
  for (const proto::AgentConfig& agent : (*team)->config.agents()) {
    is_right = AddAgent(**team, agent, agents, json) && is_right;
  }
  json.EndArray().Key("clients").BeginArray();
  for (const proto::ListedClient& client : listed.clients()) AddClient(client, clients, json);
  json.EndArray().EndObject();
  return context.Print(is_right ? ExitCode::kDone : ExitCode::kFailed, json.text(),
                       agents.Text() + (listed.clients().empty() ? "" : clients.Text()));
}

// --- keys add-signing ---

ExitCode ShowAdded(const CommandContext& context, const std::filesystem::path& file,
                   const std::vector<std::string>& agents) {
  JsonWriter json;
  json.BeginObject().Key("file").String(file.string()).Key("is_changed").Bool(!agents.empty());
  json.Key("agents").BeginArray();
  std::string names;
  for (const std::string& name : agents) {
    json.String(name);
    names += (names.empty() ? "" : ", ") + name;
  }
  json.EndArray().EndObject();
  const std::string text =
      names.empty() ? "every agent has a signing key; nothing to add"
                    : "added signing keys for " + names +
                          "; copy each NAME.sign to its agent and the team file to all agents, then restart the agents";
  return context.Done(json.text(), file.string() + ": " + text);
}

ExitCode CompleteTeamFile(CommandContext& context) {
  if (context.TeamPath().empty()) return context.Report(context.Team().error());
  const std::filesystem::path file = context.TeamPath();
  const auto yaml = ReadTextFile(file);
  if (!yaml) return context.Report(yaml.error());
  NewFiles files;
  const auto added = AddSigningKeys(*yaml, file, &files);
  if (!added) return context.Report(added.error());
  if (added->agents.empty()) return ShowAdded(context, file, {});
  // Publish the secret keys first, so that the team file never names a key whose secret was lost.
  if (const auto published = files.Publish(); !published) return context.Report(published.error());
  if (const auto replaced = ReplaceFile(file, added->yaml); !replaced) {
    files.TakeBack();
    return context.Report(replaced.error());
  }
  return ShowAdded(context, file, added->agents);
}

}  // namespace

void AddKeysCommands(Command& app, CommandContext& context) {
  auto arguments = std::make_shared<KeysArguments>();
  Command& keys = app.AddSubcommand("keys", "Make and list keys of agents and clients");
  keys.RequireSubcommand();
  Command& made = AddCommand(keys, "new", "Make the keys of an agent or of a client", {"moonctl keys new rover4"});
  made.AddOption("name", arguments->name, "Name of the agent or client").Required().TypeName("NAME");
  made.AddFlag("--client", arguments->is_client, "Make the keys of a client, in your own folder");
  made.AddOption("--out", arguments->out,
                 "Folder for the keys (default: beside the team file; for clients ~/.config/moondb)")
      .TypeName("FOLDER");
  made.Callback(
      [&context, arguments] { context.action = [&context, arguments] { return MakeKeys(context, *arguments); }; });
  AddCommand(keys, "show", "Show fingerprints of the team's keys, and which secret keys are on this machine",
             {"moonctl keys show"})
      .Callback([&context] { context.action = [&context] { return ShowKeys(context); }; });
  Command& add = AddCommand(keys, "add-signing", "Add missing signing keys to a team file",
                            {"moonctl keys add-signing team.yaml"});
  add.AddOption("file", arguments->file, "Team file (default: -t or $MOONDB_TEAM)").TypeName("FILE");
  add.Callback([&context, arguments] {
    if (!arguments->file.empty()) context.team_path = arguments->file;
    context.action = [&context] { return CompleteTeamFile(context); };
  });
}

}  // namespace moondb
