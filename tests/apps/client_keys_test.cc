// Tests with real processes over TCP on this machine: remote operators with client keys, and `record list -f`.

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/stat.h>

#include "model/text.h"
#include "tests/apps/process_team.h"
#include "tests/free_port.h"
#include "tests/scoped_umask.h"

namespace moondb {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class ClientKeysProcessTest : public ProcessTeam {
 protected:
  // Makes rover1 accept clients over TCP.
  void SetUp() override {
    ProcessTeam::SetUp();
    std::string text = *ReadTextFile(team_file_);
    const std::string name = "    name: rover1\n";
    ASSERT_NE(text.find(name), std::string::npos);
    text.insert(text.find(name) + name.size(),
                "    client_address: \"tcp://127.0.0.1:" + std::to_string(FreePort()) + "\"\n");
    ASSERT_TRUE(WriteTextFile(team_file_, text).has_value());
  }
  static std::vector<std::string> With(const std::filesystem::path& key, std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {"--key", key.string()});
    return arguments;
  }
  // Returns the default file of the client's secret key.
  std::filesystem::path KeyOf(const std::string& client) const {
    return folder_ / "config" / "moondb" / (client + ".sec");
  }
};

TEST_F(ClientKeysProcessTest, AKeyGrantsItsRightsUntilItIsRevoked) {
  const auto added = MoonctlJson(0, {"clients", "add", "anna", "--rights", "view"});
  EXPECT_EQ(added.fields().at("secret_file").string_value(), KeyOf("anna").string());
  struct stat status {};
  ASSERT_EQ(::stat(KeyOf("anna").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0600u);
  ASSERT_EQ(::stat(KeyOf("anna").parent_path().c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777, 0700u);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "anna.sec")) << "what lies there is copied to robots";
  MoonctlExpecting(0, {"up"});

  EXPECT_THAT(MoonctlExpecting(0, With(KeyOf("anna"), {"status", "-a", "rover1"})), HasSubstr("leader"));
  EXPECT_THAT(MoonctlExpecting(0, With(KeyOf("anna"), {"status", "--via", "rover1"})),
              AllOf(HasSubstr("rover3"), Not(HasSubstr("unreachable"))));
  const Outcome refused =
      Moonctl(With(KeyOf("anna"), {"record", "insert", "temperature", "{\"celsius\": 1}", "-a", "rover1"}));
  EXPECT_EQ(refused.exit_code, 4);
  EXPECT_THAT(refused.error, HasSubstr("this needs the right to share; the key of anna has the right to view"));
  MoonctlExpecting(4, With(KeyOf("anna"), {"role", "swap", "--via", "rover1"}));
  // rover2 has no client_address, so moonctl reaches it through rover1.
  const Outcome through = Moonctl(With(KeyOf("anna"), {"status", "-a", "rover2"}));
  EXPECT_EQ(through.exit_code, 0) << through.out;
  EXPECT_EQ(through.error, "moonctl: requests are relayed by rover1, over the radio\n");

  MoonctlExpecting(4, {"clients", "add", "anna", "--rights", "share"});
  MoonctlExpecting(0, {"clients", "add", "anna", "--rights", "share", "--replace", "--out", folder_ / "new.sec"});
  EXPECT_TRUE(Until([&] {
    return Moonctl(With(folder_ / "new.sec", {"sync", "now", "-a", "rover1"})).exit_code == 0;
  }));
  EXPECT_THAT(MoonctlExpecting(4, With(KeyOf("anna"), {"status", "-a", "rover1"})),
              HasSubstr("refused: agent rover1 does not admit this key"));
  EXPECT_THAT(Moonctl(With(KeyOf("anna"), {"role", "swap"})).error, HasSubstr("does not admit this key"));
  EXPECT_THAT(MoonctlExpecting(0, {"log"}), HasSubstr("sync now (anna (key))"));

  MoonctlExpecting(0, {"clients", "revoke", "anna"});
  EXPECT_TRUE(Until([&] { return Moonctl(With(folder_ / "new.sec", {"status", "-a", "rover1"})).exit_code == 4; }));
  EXPECT_EQ(Moonctl(With(folder_ / "new.sec", {"status"})).exit_code, 3) << "the others are not reached";
  const auto shown = MoonctlJson(0, {"status", "-a", "rover1"});
  const auto& agent = shown.fields().at("agents").list_value().values(0).struct_value().fields().at("status");
  EXPECT_GE(agent.struct_value().fields().at("refused_clients").number_value(), 2);
  // `down` needs no key, because it stops processes of this machine.
  MoonctlExpecting(0, With(folder_ / "new.sec", {"down"}));
}

TEST_F(ClientKeysProcessTest, TheListIsWrittenThroughNoLinkAndForOthersToReadOnly) {
  const ScopedUmask umask(0);
  const std::filesystem::path list = folder_ / "clients.yaml";
  ASSERT_TRUE(WriteTextFile(folder_ / "victim", "another's text"));
  for (const char* end : {".part", ".new"}) std::filesystem::create_symlink("victim", list.string() + end);
  MoonctlExpecting(0, {"clients", "add", "anna", "--rights", "view"});
  EXPECT_EQ(ModeOf(list), 0644u);
  MoonctlExpecting(0, {"clients", "add", "bob", "--rights", "view"});
  MoonctlExpecting(0, {"clients", "revoke", "anna"});
  EXPECT_EQ(ModeOf(list), 0644u);
  EXPECT_FALSE(std::filesystem::is_symlink(list));
  EXPECT_EQ(*ReadTextFile(folder_ / "victim"), "another's text");
  EXPECT_EQ(ModeOf(KeyOf("bob")), 0600u);
  EXPECT_EQ(ModeOf(KeyOf("bob").parent_path()), 0700u);
}

TEST_F(ClientKeysProcessTest, ListsClientsAndReportsErrors) {
  MoonctlExpecting(0, {"clients", "list"});
  ASSERT_TRUE(WriteTextFile(folder_ / "clients.yaml", "# our own words\nclients: []\n").has_value());
  MoonctlExpecting(0, {"clients", "add", "anna", "--rights", "command"});
  MoonctlExpecting(0, {"clients", "add", "wall", "--rights", "view", "--public-key", folder_ / "rover2.pub"});
  EXPECT_THAT(MoonctlExpecting(0, {"clients", "list"}), AllOf(HasSubstr("anna    command"), HasSubstr("wall    view")));
  EXPECT_THAT(*ReadTextFile(folder_ / "clients.yaml"), testing::StartsWith("# our own words\nclients:\n"));
  MoonctlExpecting(0, {"clients", "add", "third", "--rights", "share"});
  MoonctlExpecting(0, {"clients", "revoke", "wall"});
  EXPECT_THAT(MoonctlExpecting(0, {"clients", "list"}),
              AllOf(HasSubstr("anna"), HasSubstr("third"), Not(HasSubstr("wall"))));
  MoonctlExpecting(0, {"clients", "add", "wall", "--rights", "view", "--public-key", folder_ / "rover2.pub"});

  const auto error = [this](int exit_code, std::vector<std::string> arguments) {
    const Outcome outcome = Moonctl(std::move(arguments));
    EXPECT_EQ(outcome.exit_code, exit_code) << outcome.error;
    return outcome.error;
  };
  EXPECT_THAT(error(2, {"clients", "add", "bob", "--rights", "vew"}), HasSubstr("did you mean \"view\"?"));
  EXPECT_THAT(error(2, {"clients", "add", "B o b", "--rights", "view"}), HasSubstr("expected at most 32 lower-case"));
  EXPECT_THAT(error(2, {"clients", "add", "bob", "--rights", "view", "--public-key", folder_ / "rover2.pub"}),
              HasSubstr("is already that of clients[2]"));
  EXPECT_THAT(error(1, {"clients", "revoke", "ana"}), HasSubstr("did you mean \"anna\"?"));
  EXPECT_FALSE(std::filesystem::exists(KeyOf("bob")));
  EXPECT_THAT(error(2, {"--key", folder_ / "none.sec", "status"}),
              AllOf(HasSubstr("--key"), HasSubstr("no such file")));
  environment_["MOONDB_CLIENT_KEY"] = folder_ / "none.sec";
  EXPECT_THAT(error(2, {"role", "swap"}), AllOf(HasSubstr("MOONDB_CLIENT_KEY"), HasSubstr("no such file")));
  MoonctlExpecting(0, {"clients", "list"});  // `clients list` needs no key.
  environment_.erase("MOONDB_CLIENT_KEY");
  // If the client list cannot be written, `clients add` must not leave a secret key behind or lose a listed client.
  const std::string list = *ReadTextFile(folder_ / "clients.yaml");
  std::filesystem::create_directory(folder_ / "clients.yaml.new");
  EXPECT_THAT(error(1, {"clients", "add", "bob", "--rights", "view"}), HasSubstr("cannot be written"));
  EXPECT_FALSE(std::filesystem::exists(KeyOf("bob")));
  std::filesystem::remove(folder_ / "clients.yaml.new");
  ASSERT_TRUE(WriteTextFile(folder_ / "clients.yaml", list + "  # until May\n").has_value());
  EXPECT_THAT(error(4, {"clients", "revoke", "anna"}), HasSubstr("this comment would be lost"));
  EXPECT_EQ(*ReadTextFile(folder_ / "clients.yaml"), list + "  # until May\n");

  ASSERT_TRUE(WriteTextFile(folder_ / "clients.yaml", "clients: [{nmae: x}]\n").has_value());
  EXPECT_THAT(error(2, {"clients", "list"}), HasSubstr("clients.yaml:1:"));
  EXPECT_THAT(error(2, {"clients", "add", "bob", "--rights", "view"}), HasSubstr("did you mean \"name\"?"));
  MoonctlExpecting(0, {"up", "-a", "rover1"});  // rover1 starts, but accepts no client over TCP.
  EXPECT_THAT(*ReadTextFile(folder_ / "moondb-data" / "rover1" / "agent.log"),
              AllOf(HasSubstr("clients.yaml:1:"), HasSubstr("no client is admitted")));
}

TEST_F(ClientKeysProcessTest, ConcurrentAdditionsLoseNoClient) {
  std::vector<std::unique_ptr<Child>> children;
  for (int i = 0; i < 8; ++i) {
    const std::string name = "c" + std::to_string(i);
    std::filesystem::create_directory(folder_ / name);
    children.push_back(
        std::make_unique<Child>(std::vector<std::string>{MOONCTL_PROGRAM, "clients", "add", name, "--rights", "view"},
                                environment_, folder_ / name));
  }
  for (const auto& child : children) EXPECT_EQ(child->Wait().exit_code, 0);
  const std::string shown = MoonctlExpecting(0, {"clients", "list"});
  for (int i = 0; i < 8; ++i) EXPECT_THAT(shown, HasSubstr("c" + std::to_string(i) + " "));
}

TEST_F(ClientKeysProcessTest, FollowsNewRecordsUntilInterrupted) {
  MoonctlExpecting(0, {"up", "-a", "rover1"});
  const std::vector<std::string> insert = {"record", "insert", "temperature", "{\"celsius\": -20}", "-a", "rover1"};
  const std::string before = MoonctlExpecting(0, insert);
  for (const char* child : {"json", "text"}) std::filesystem::create_directory(folder_ / child);
  Child json({MOONCTL_PROGRAM, "record", "list", "temperature", "-f", "-a", "rover1", "--json"}, environment_,
             folder_ / "json");
  Child text(
      {"/bin/bash", "-c", std::string("set -o pipefail; ") + MOONCTL_PROGRAM + " record list -f -a rover1 | head -n 1"},
      environment_, folder_ / "text");
  // The two commands show each new record at once, but no record that was stored before they started.
  std::string key;
  EXPECT_TRUE(Until([&] {
    key = MoonctlExpecting(0, insert);
    key.resize(key.size() - 1);
    return json.Out().find(key) != std::string::npos;
  }));
  EXPECT_THAT(json.Out(), AllOf(Not(HasSubstr(before)), HasSubstr("\"celsius\":-20")));
  MoonctlExpecting(0, insert);
  MoonctlExpecting(0, insert);
  const Outcome piped = text.Wait();
  EXPECT_EQ(piped.exit_code, 0);
  EXPECT_EQ(piped.error, "");
  EXPECT_THAT(piped.out, HasSubstr("  temperature  rover1  "));
  json.Signal(SIGINT);
  EXPECT_EQ(json.Wait().exit_code, 0);
}

}  // namespace
}  // namespace moondb
