#include "runtime/address.h"

#include <gtest/gtest.h>

#include "runtime/address_book.h"
#include "runtime/envelope.h"
#include "runtime/role_table.h"

namespace moondb {
namespace {

TEST(AddressTest, TextNamesAgentsAndAliases) {
  EXPECT_EQ(ToString(Address{2, "storage"}), "2/storage");
  EXPECT_EQ(ToString(Address{kLeaderAlias, "sync"}), "@leader/sync");
  EXPECT_EQ(ToString(Address{kSurvivorAlias, "a"}), "@survivor/a");
  EXPECT_EQ(ToString(Address{kBaseAlias, "a"}), "@base/a");
  EXPECT_EQ(ToString(Address{kClients, "c1"}), "@clients/c1");
}

TEST(RoleTableTest, AliasesResolveToNoAgentUntilSet) {
  RoleTable roles(/*base_station=*/9);
  EXPECT_EQ(roles.Resolve(kLeaderAlias), 0u);
  EXPECT_EQ(roles.Resolve(kSurvivorAlias), 0u);
  EXPECT_EQ(roles.Resolve(kBaseAlias), 9u);
  proto::RoleAssignment assignment;
  assignment.set_leader(2);
  assignment.set_survivor(3);
  roles.SetRoles(assignment);
  EXPECT_EQ(roles.Resolve(kLeaderAlias), 2u);
  EXPECT_EQ(roles.Resolve(kSurvivorAlias), 3u);
  EXPECT_EQ(roles.Resolve(5), 5u);
  EXPECT_EQ(roles.Resolve(kClients), kClients);
}

TEST(EnvelopeTest, OriginIsSetOnlyIfThereIsNone) {
  proto::Message message;
  WriteEnvelope({1, "a"}, {2, "b"}, message);
  EXPECT_EQ(message.agent_id(), 1u);
  WriteEnvelope({2, "b"}, {3, "c"}, message);
  EXPECT_EQ(message.agent_id(), 1u);
  EXPECT_EQ(message.destination_id(), 3u);
  EXPECT_EQ(message.destination_actor(), "c");
  EXPECT_EQ(SenderOf(message), (Address{2, "b"}));
}

TEST(AddressBookTest, KeepsEachAddressOnceUpToALimit) {
  AddressBook book;
  const Address* first = book.Keep({2, "sync"});
  ASSERT_NE(first, nullptr);
  EXPECT_EQ(*first, (Address{2, "sync"}));
  for (std::size_t i = 1; i < AddressBook::kAddressesMax; ++i) {
    ASSERT_NE(book.Keep({3, "actor" + std::to_string(i)}), nullptr);
  }
  EXPECT_EQ(book.Keep({4, "sync"}), nullptr);
  EXPECT_EQ(AddressBook().Keep({2, std::string(AddressBook::kNameBytesMax + 1, 'x')}), nullptr);
  EXPECT_EQ(book.Keep({2, "sync"}), first);
}

}  // namespace
}  // namespace moondb
