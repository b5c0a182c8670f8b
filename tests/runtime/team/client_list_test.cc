#include "runtime/team/client_list.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "model/text.h"
#include "runtime/team/curve_keys.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr ClientKeys::Time kStart{std::chrono::hours(5)};
const std::string kKeyA = MakeCurveKeys().value().public_key;
const std::string kKeyB = MakeCurveKeys().value().public_key;

std::string Entry(const std::string& name, const std::string& key, const std::string& rights) {
  return "  - {name: " + name + ", key: \"" + key + "\", rights: " + rights + "}\n";
}

TEST(ClientListTest, ReadsAndWritesClients) {
  const std::string text = "# ours\nclients:\n" + Entry("anna", kKeyA, "command") + Entry("wall-2", kKeyB, "view");
  const auto list = ParseClientList(text, "c");
  ASSERT_TRUE(list.has_value()) << ToString(list.error());
  ASSERT_EQ(list->clients_size(), 2);
  EXPECT_EQ(list->clients(0).name(), "anna");
  EXPECT_EQ(list->clients(0).key(), kKeyA);
  EXPECT_EQ(list->clients(0).rights(), proto::CLIENT_RIGHTS_COMMAND);
  EXPECT_EQ(list->clients(1).rights(), proto::CLIENT_RIGHTS_VIEW);
  EXPECT_EQ(ClientListText(*list, "# ours\n"), text);
  EXPECT_TRUE(ParseClientList(ClientListText({}, "# nobody\n"), "c").has_value());
}

TEST(ClientListTest, ReportsAllErrorsAndTheirPlaces) {
  const std::string text = "clients:\n" + Entry("Anna", "short", "all") + Entry("bob", kKeyA, "none") +
                           Entry("bob", kKeyA, "share") + "  - {nmae: eve}\n";
  const auto list = ParseClientList(text, "c");
  ASSERT_FALSE(list.has_value());
  EXPECT_EQ(list.error().code, ErrorCode::kInvalid);
  for (const char* error :
       {"c:2:12: clients[0].name: expected at most 32 lower-case letters",
        "clients[0].key: expected a public key (40 characters in Z85), got \"short\"", "clients[0].rights: expected",
        "clients[1].rights: expected view, share or command, got \"none\"",
        "clients[2].name: is already that of clients[1]", "clients[2].key: is already that of clients[1]",
        "clients[3].nmae", "clients[3].key: missing", "clients[3].rights: missing"}) {
    EXPECT_THAT(list.error().text, testing::HasSubstr(error));
  }
}

TEST(ClientListTest, BoundsTheList) {
  std::string text = "clients:\n";
  for (int i = 0; i <= kListedClientsMax; ++i) {
    text += Entry("c" + std::to_string(i), MakeCurveKeys().value().public_key, "view");
  }
  EXPECT_FALSE(ParseClientList(text, "c").has_value());
  EXPECT_FALSE(ParseClientList("clients: [[[[", "c").has_value());
}

class ClientKeysTest : public testing::Test {
 protected:
  void Write(const std::string& entries) { ASSERT_TRUE(WriteTextFile(path_, "clients:\n" + entries).has_value()); }

  const TemporaryFolder temporary_;
  const std::filesystem::path path_ = temporary_.path() / "clients.yaml";
};

TEST_F(ClientKeysTest, ReadsFileChangesWithinASecond) {
  auto keys = ClientKeys::Open(path_, kStart);
  EXPECT_FALSE(keys.Find(kKeyA, kStart)) << "a list that is not there";
  Write(Entry("anna", kKeyA, "view"));
  EXPECT_FALSE(keys.Find(kKeyA, kStart + milliseconds(999))) << "it does not look at the file so often";
  ASSERT_TRUE(keys.Find(kKeyA, kStart + seconds(1)));
  EXPECT_EQ(keys.Find(kKeyA, kStart + seconds(1))->name(), "anna");

  Write(Entry("anna", kKeyB, "share"));
  EXPECT_FALSE(keys.Find(kKeyA, kStart + seconds(2))) << "replaced";
  EXPECT_EQ(keys.Find(kKeyB, kStart + seconds(2))->rights(), proto::CLIENT_RIGHTS_SHARE);
  std::filesystem::remove(path_);
  EXPECT_FALSE(keys.Find(kKeyB, kStart + seconds(3)));
}

TEST_F(ClientKeysTest, KeepsTheListIfTheFileBecomesInvalid) {
  Write(Entry("anna", kKeyA, "view"));
  auto keys = ClientKeys::Open(path_, kStart);
  testing::internal::CaptureStdout();
  ASSERT_TRUE(WriteTextFile(path_, "clients: [{name: bob}").has_value());
  for (int second = 1; second < 5; ++second) EXPECT_TRUE(keys.Find(kKeyA, kStart + seconds(second)));
  const std::string log = testing::internal::GetCapturedStdout();
  EXPECT_EQ(log.find("the clients listed before"), log.rfind("the clients listed before")) << "reported once: " << log;
  EXPECT_THAT(log, testing::HasSubstr("the clients listed before"));
  Write("");
  EXPECT_TRUE(keys.Find(kKeyA, kStart + seconds(5))) << "an empty list is a mistake too";
  Write(Entry("bob", kKeyB, "view"));
  EXPECT_FALSE(keys.Find(kKeyA, kStart + seconds(6)));
  EXPECT_TRUE(keys.Find(kKeyB, kStart + seconds(6)));
}

TEST_F(ClientKeysTest, StartsWithoutClientsIfTheListIsInvalidAndReadsTheRepairedOne) {
  Write(Entry("anna", "no key", "view"));
  testing::internal::CaptureStdout();
  auto keys = ClientKeys::Open(path_, kStart);
  EXPECT_FALSE(keys.Find("no key", kStart));
  Write(Entry("anna", kKeyA, "view"));
  EXPECT_TRUE(keys.Find(kKeyA, kStart + seconds(1)));
  std::filesystem::remove(path_);
  for (int second = 2; second < 5; ++second) EXPECT_FALSE(keys.Find(kKeyA, kStart + seconds(second)));
  const std::string log = testing::internal::GetCapturedStdout();
  EXPECT_THAT(log, testing::HasSubstr("no client is admitted until it is repaired"));
  EXPECT_THAT(log, testing::HasSubstr("lists 1 client(s)"));
  EXPECT_THAT(log, testing::HasSubstr("there is no " + path_.string()));
  EXPECT_EQ(log.find("there is no"), log.rfind("there is no")) << "reported once: " << log;
}

}  // namespace
}  // namespace moondb
