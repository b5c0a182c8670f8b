#include "apps/common/data_folder.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "client/endpoint.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

class DataFolderTest : public testing::Test {
 protected:
  const TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path() / "data";
};

TEST_F(DataFolderTest, DefaultIsBesideTheTeamFile) {
  EXPECT_EQ(DefaultDataRoot("/etc/moon"), "/etc/moon/moondb-data");
  EXPECT_EQ(DefaultDataRoot("."), std::filesystem::current_path() / "moondb-data");
}

// A team with the agents 1 (rover1) and 2 (rover2).
class DataOwnerTest : public testing::Test {
 protected:
  DataOwnerTest() {
    team_.set_team_id("00112233445566778899aabbccddeeff");
    for (const std::uint32_t id : {1, 2}) {
      team_.add_agents()->set_id(id);
      team_.mutable_agents(static_cast<int>(id) - 1)->set_name("rover" + std::to_string(id));
    }
  }

  void Mark(const std::string& folder, AgentId agent) { Mark(folder, {team_.team_id(), agent}); }
  void Mark(const std::string& folder, const DataOwner& owner) {
    std::filesystem::create_directories(root_ / folder);
    const auto marked = MarkDataFolder(root_ / folder, owner);
    ASSERT_TRUE(marked.has_value()) << ToString(marked.error());
  }

  const TemporaryFolder temporary_;
  const std::filesystem::path root_ = temporary_.path() / "moondb-data";
  proto::TeamConfig team_;
};

TEST_F(DataOwnerTest, FindsAFolderByTheAgentsIdRegardlessOfItsName) {
  EXPECT_EQ(FindDataFolder(root_, team_, team_.agents(1)).value(), root_ / "rover2");
  Mark("rover2", 2);
  team_.mutable_agents(1)->set_name("scout");
  EXPECT_EQ(FindDataFolder(root_, team_, team_.agents(1)).value(), root_ / "rover2");
  // Two agents that swap names keep their data.
  Mark("rover1", 1);
  team_.mutable_agents(0)->set_name("rover2");
  team_.mutable_agents(1)->set_name("rover1");
  EXPECT_EQ(FindDataFolder(root_, team_, team_.agents(0)).value(), root_ / "rover1");
  EXPECT_EQ(FindDataFolder(root_, team_, team_.agents(1)).value(), root_ / "rover2");
}

TEST_F(DataOwnerTest, GivesANewAgentWithAnOldNameItsOwnFolder) {
  Mark("rover2", 1);
  EXPECT_EQ(FindDataFolder(root_, team_, team_.agents(1)).value(), root_ / "rover2-2");
}

TEST_F(DataOwnerTest, LeavesAnotherTeamsDataAlone) {
  Mark("rover1", {"ffeeddccbbaa99887766554433221100", 1});
  const auto found = FindDataFolder(root_, team_, team_.agents(0));
  ASSERT_FALSE(found.has_value());
  EXPECT_EQ(found.error().code, ErrorCode::kRefused);
  EXPECT_EQ(found.error().text,
            "holds the data of agent 1 of another team (its team id begins with ffeeddcc, this team's with 00112233)");
  const auto marked = MarkDataFolder(root_ / "rover1", DataOwnerOf(team_, team_.agents(0)));
  ASSERT_FALSE(marked.has_value());
  EXPECT_EQ(marked.error().text, found.error().text);
}

TEST_F(DataOwnerTest, DoesNotChooseBetweenCopies) {
  team_.mutable_agents(1)->set_name("scout");
  Mark("rover2", 2);
  Mark("rover2.old", 2);  // Ignored, because an agent's name has no dot.
  EXPECT_EQ(FindDataFolder(root_, team_, team_.agents(1)).value(), root_ / "rover2");
  Mark("copy", 2);
  EXPECT_EQ(FindDataFolder(root_, team_, team_.agents(1)).error().code, ErrorCode::kRefused);
  Mark("scout", 2);
  EXPECT_EQ(FindDataFolder(root_, team_, team_.agents(1)).value(), root_ / "scout");
}

TEST_F(DataOwnerTest, IgnoresInvalidOwnerFiles) {
  std::filesystem::create_directories(root_ / "rover1");
  for (const std::string text : {"", "agent_id: 0\n", "agent_id: 70000\n", "agent_id: x\nteam_id: y\n", "\x01\x02"}) {
    std::ofstream(root_ / "rover1" / "agent.identity") << text;
    EXPECT_EQ(ReadDataOwner(root_ / "rover1"), std::nullopt) << text;
  }
  std::ofstream(root_ / "rover1" / "agent.identity") << std::string(100'000, 'x');
  EXPECT_EQ(ReadDataOwner(root_ / "rover1"), std::nullopt);
}

TEST_F(DataFolderTest, StoresTheEndpointForClients) {
  std::filesystem::create_directories(folder_);
  EXPECT_EQ(ReadEndpoint(folder_), "");
  ASSERT_TRUE(WriteEndpoint(folder_, "ipc:///run/a.sock").has_value());
  ASSERT_TRUE(WriteEndpoint(folder_, "ipc:///run/b.sock").has_value());
  EXPECT_EQ(ReadEndpoint(folder_), "ipc:///run/b.sock");
}

TEST_F(DataFolderTest, OneProcessLocksItAtATime) {
  EXPECT_EQ(OwnerOf(folder_), 0);
  {
    const auto first = DataFolderLock::Take(folder_);
    ASSERT_TRUE(first.has_value()) << ToString(first.error());
    EXPECT_EQ(OwnerOf(folder_), ::getpid());
    const auto second = DataFolderLock::Take(folder_);
    ASSERT_FALSE(second.has_value());
    EXPECT_EQ(second.error().code, ErrorCode::kRefused);
    EXPECT_EQ(OwnerOf(folder_), ::getpid());  // OwnerOf does not release the lock.
  }
  EXPECT_EQ(OwnerOf(folder_), 0);
  EXPECT_TRUE(DataFolderLock::Take(folder_).has_value());
}

TEST_F(DataFolderTest, IgnoresALeftoverPidFile) {
  std::filesystem::create_directories(folder_);
  std::ofstream(folder_ / "agent.pid") << "1\n";
  EXPECT_EQ(OwnerOf(folder_), 0);
  EXPECT_TRUE(DataFolderLock::Take(folder_).has_value());
}

// Simulates a read-only file system, on which the pid file cannot be locked.
TEST_F(DataFolderTest, KnowsTheOwnerByTheFoldersOwnLock) {
  {
    const auto lock = DataFolderLock::Take(folder_);
    ASSERT_TRUE(lock.has_value());
    std::filesystem::remove(folder_ / "agent.pid");
    EXPECT_EQ(OwnerOf(folder_), ::getpid());
    EXPECT_EQ(DataFolderLock::Take(folder_).error().code, ErrorCode::kRefused);
  }
  EXPECT_EQ(OwnerOf(folder_), 0);
}

TEST_F(DataFolderTest, OnlyThisUserHasAccess) {
  std::filesystem::create_directory(folder_);
  std::filesystem::permissions(folder_, std::filesystem::perms::all);
  const auto refused = DataFolderLock::Take(folder_);
  ASSERT_FALSE(refused);
  EXPECT_NE(ToString(refused.error()).find("chmod go-w"), std::string::npos) << ToString(refused.error());
  std::filesystem::permissions(folder_, std::filesystem::perms::owner_all);
  EXPECT_TRUE(DataFolderLock::Take(folder_));
}

TEST_F(DataFolderTest, DoesNotFollowALinkToAnotherFile) {
  std::filesystem::create_directory(folder_);
  const std::filesystem::path victim = temporary_.path() / "victim";
  std::ofstream(victim) << "mine";
  std::filesystem::create_symlink(victim, folder_ / "agent.pid");
  EXPECT_FALSE(DataFolderLock::Take(folder_));
  std::string text;
  std::ifstream(victim) >> text;
  EXPECT_EQ(text, "mine");
}

TEST_F(DataFolderTest, ReportsWhyAFolderCannotBeCreated) {
  std::filesystem::create_directories(folder_);
  std::ofstream(folder_ / "file") << "x";
  const auto lock = DataFolderLock::Take(folder_ / "file" / "data");
  ASSERT_FALSE(lock.has_value());
  EXPECT_EQ(lock.error().code, ErrorCode::kInternal);
  EXPECT_NE(lock.error().field.find("file/data"), std::string::npos);
}

}  // namespace
}  // namespace moondb
