#include "apps/moonctl/diagnosis.h"

#include <gmock/gmock.h>

#include "apps/common/process_limits.h"
#include "apps/moonctl/health.h"

namespace moondb {
namespace {

using testing::HasSubstr;

class DiagnosisTest : public testing::Test {
 protected:
  DiagnosisTest() {
    agent_.set_name("rover1");
    agent_.set_address("tcp://10.0.0.11:7400");
    team_.mutable_retention()->set_disk_free_mb_min(512);
    facts_.data_folder = "/var/lib/moondb/moondb-data/rover1";
    facts_.disk_free_bytes = 20'000'000'000;
    facts_.year = kYearMin;
    facts_.is_clock_synchronised = true;
    facts_.is_running = true;
    facts_.open_files_max = kOpenFilesLeast;
    facts_.memory_available_bytes = kMemoryMin_bytes;
    facts_.version = facts_.agent_version = "0.1.0";
    PeerFacts& peer = facts_.peers.emplace_back();
    peer.name = "rover2";
    peer.address = "tcp://10.0.0.12:7400";
    peer.mtu_bytes = kMtuMin_bytes;
    peer.loss = kLossMax;
    peer.clock_offset_s = kClockOffsetMax_s;
    peer.version = "0.1.0";
  }

  // Returns the only check that is not good. The test fails if there is another number of them.
  RobotCheck OnlyFinding() {
    RobotCheck found;
    int count = 0;
    for (const RobotCheck& check : Diagnose(team_, agent_, facts_)) {
      if (check.kind == RobotCheck::Kind::kGood) continue;
      found = check;
      ++count;
    }
    EXPECT_EQ(count, 1);
    return found;
  }

  void ExpectFault(const std::string& what, const std::string& text) {
    const RobotCheck found = OnlyFinding();
    EXPECT_EQ(found.what, what);
    EXPECT_EQ(found.kind, RobotCheck::Kind::kFault) << found.text;
    EXPECT_THAT(found.text, HasSubstr(text));
    EXPECT_FALSE(found.remedy.empty());
  }

  void ExpectAdvice(const std::string& what, const std::string& text) {
    const RobotCheck found = OnlyFinding();
    EXPECT_EQ(found.what, what);
    EXPECT_EQ(found.kind, RobotCheck::Kind::kAdvice) << found.text;
    EXPECT_THAT(found.text, HasSubstr(text));
  }

  proto::TeamConfig team_;
  proto::AgentConfig agent_;
  RobotFacts facts_;
};

TEST_F(DiagnosisTest, FindsNothingAtTheLimits) {
  for (const RobotCheck& check : Diagnose(team_, agent_, facts_)) {
    EXPECT_EQ(check.kind, RobotCheck::Kind::kGood) << check.what << ": " << check.text;
  }
}

TEST_F(DiagnosisTest, FindsKeysThatDoNotMatch) {
  facts_.keys_error = "rover1.sec: does not fit";
  ExpectFault("keys", "does not fit");
}

TEST_F(DiagnosisTest, AdvisesKeysForATeamWithoutThem) {
  team_.set_insecure(true);
  ExpectAdvice("keys", "insecure");
}

TEST_F(DiagnosisTest, FindsADataFolderThatCannotBeUsed) {
  facts_.data_folder_error = "/var/lib/moondb: Read-only file system";
  ExpectFault("data", "Read-only");
}

TEST_F(DiagnosisTest, FindsADataFolderInMemory) {
  facts_.is_memory_disk = true;
  ExpectFault("data", "a reboot loses all records");
}

TEST_F(DiagnosisTest, FindsAFullDisk) {
  facts_.disk_free_bytes = 511'000'000;
  ExpectFault("disk", "511.0 MB are free, less than the 512.0 MB");
}

TEST_F(DiagnosisTest, FindsAClockThatWasNeverSet) {
  facts_.year = 1970;
  ExpectFault("clock", "1970");
}

TEST_F(DiagnosisTest, FindsAClockThatDiffersFromAPeers) {
  facts_.peers[0].clock_offset_s = -11;
  ExpectFault("clock", "differs by 11 s from the clock of rover2");
}

TEST_F(DiagnosisTest, AdvisesToSynchroniseTheClock) {
  facts_.is_clock_synchronised = false;
  ExpectAdvice("clock", "the clock is not synchronised");
}

TEST_F(DiagnosisTest, FindsLimitsOfTheProcess) {
  facts_.open_files_max = 1024;
  ExpectFault("limits", "1024 files");
  facts_.open_files_max = kOpenFilesLeast;
  facts_.memory_available_bytes = kMemoryMin_bytes - 1;
  ExpectFault("limits", "memory");
}

TEST_F(DiagnosisTest, FindsAnAddressThatIsTaken) {
  facts_.listen_error = "tcp://10.0.0.11:7400: Address already in use";
  ExpectFault("address", "in use");
}

TEST_F(DiagnosisTest, FindsANameThatIsALoopbackAddressOnThisComputer) {
  facts_.listen_loopback = "127.0.1.1";
  EXPECT_EQ(Diagnose(team_, agent_, facts_).at(6).kind, RobotCheck::Kind::kGood) << "no agent is elsewhere";
  team_.add_agents()->set_address("tcp://10.0.0.12:7400");
  team_.mutable_agents(0)->set_id(2);
  ExpectFault("address", "is 127.0.1.1 on this computer");
}

TEST_F(DiagnosisTest, NamesTheComputerOfAnAgentThatIsElsewhere) {
  facts_.is_elsewhere = true;
  facts_.keys_error = "rover1.sec: no such file";
  ExpectFault("keys", "has the secret keys of another agent, but not those of rover1");
  EXPECT_THAT(OnlyFinding().remedy, HasSubstr("on the computer of rover1"));
}

TEST_F(DiagnosisTest, NamesTheVersionsOfSqliteThatHaveTheWalResetBug) {
  const auto text = [this](int version) {
    facts_.sqlite_version = version;
    return Diagnose(team_, agent_, facts_).at(2).text;
  };
  EXPECT_EQ(text(3'051'003), "the store uses SQLite 3.51.3");
  EXPECT_THAT(text(3'051'002), HasSubstr("SQLite 3.51.2, which has the WAL-reset bug"));
  EXPECT_THAT(text(3'040'001), HasSubstr("let no other program write or checkpoint"));
}

TEST_F(DiagnosisTest, FindsAnAgentThatDoesNotAnswer) {
  facts_.agent_error = "no answer within 3 s";
  ExpectFault("agent", "no answer");
}

TEST_F(DiagnosisTest, AdvisesToStartOrRestartTheAgent) {
  facts_.agent_version = "0.0.9";
  facts_.peers[0].version = "0.0.9";
  ExpectAdvice("agent", "the running agent has version 0.0.9");
  facts_.agent_version.clear();
  facts_.peers[0].version.clear();
  facts_.is_running = false;
  ExpectAdvice("agent", "is not running");
}

TEST_F(DiagnosisTest, FindsFaultsOfTheWayToAPeer) {
  PeerFacts& peer = facts_.peers[0];
  const PeerFacts good = peer;
  peer.lookup_error = "Name or service not known";
  ExpectFault("to rover2", "Name or service not known");
  peer = good;
  peer.connect_error = "Connection refused";
  ExpectFault("to rover2", "refused");
  peer = good;
  peer.loss = 0.25;
  ExpectFault("to rover2", "25 % of pings");
  peer = good;
  peer.other_team_file = "hash 1, here 2";
  ExpectFault("to rover2", "has a different team file");
  peer = good;
  peer.mtu_bytes = kMtuMin_bytes - 1;
  ExpectAdvice("to rover2", "1279 bytes");
  peer = good;
  peer.version = "0.2.0";
  ExpectAdvice("to rover2", "version 0.2.0");
}

}  // namespace
}  // namespace moondb
