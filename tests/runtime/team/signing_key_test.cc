#include "runtime/team/signing_key.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "model/term.h"
#include "proto/types.pb.h"
#include "runtime/team/key_fingerprint.h"
#include "runtime/team/record_signature.h"
#include "runtime/team/role_signature.h"
#include "runtime/team/team_config.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

SigningKey KeyOf(std::uint8_t number) {
  SigningKey::Seed seed{};
  seed[0] = number;
  return SigningKey::FromSeed(seed);
}

TEST(SigningKeyTest, OnlyItsPublicKeyVerifiesItsSignatures) {
  const SigningKey key = SigningKey::Make();
  const std::string signature = key.Sign("what was decided");
  EXPECT_EQ(signature.size(), kSignatureBytes);
  EXPECT_TRUE(IsSignatureOf(key.public_key(), "what was decided", signature));
  EXPECT_FALSE(IsSignatureOf(key.public_key(), "what was not", signature));
  EXPECT_FALSE(IsSignatureOf(SigningKey::Make().public_key(), "what was decided", signature));
  std::string changed = signature;
  changed[20] ^= 1;
  EXPECT_FALSE(IsSignatureOf(key.public_key(), "what was decided", changed));
  EXPECT_FALSE(IsSignatureOf(key.public_key(), "what was decided", signature.substr(1)));
  EXPECT_FALSE(IsSignatureOf("no key", "what was decided", signature));
}

// The second test vector of RFC 8032, section 7.1: a message of one byte.
TEST(SigningKeyTest, IsEd25519) {
  const auto bytes = [](const std::string& hex) {
    std::string text;
    for (std::size_t i = 0; i < hex.size(); i += 2) text += static_cast<char>(std::stoi(hex.substr(i, 2), nullptr, 16));
    return text;
  };
  const std::string seed_text = bytes("4ccd089b28ff96da9db6c346ec114e0f5b8a319f35aba624da8cf6ed4fb8a6fb");
  SigningKey::Seed seed;
  std::copy(seed_text.begin(), seed_text.end(), seed.begin());
  EXPECT_EQ(SigningKey::FromSeed(seed).Sign("\x72"),
            bytes("92a009a9f0d4cab8720e820b5f642540a2b27b5416503f8fb3762223ebdb69da"
                  "085ac1e43e15996e458f3613d0f11d8c387b2eaeb4302aeeb00d291612bb0c00"));
}

TEST(SigningKeyTest, IsRestoredFromItsFileThatOtherUsersCannotRead) {
  TemporaryFolder folder;
  const std::filesystem::path path = folder.File("rover1.sign");
  const SigningKey key = SigningKey::Make();
  std::ofstream(path) << key.SecretText() << "\n";
  std::filesystem::permissions(path, std::filesystem::perms(0600));
  const Result<SigningKey> read = SigningKey::Read(path);
  ASSERT_TRUE(read) << ToString(read.error());
  EXPECT_EQ(read->public_key(), key.public_key());
  std::filesystem::permissions(path, std::filesystem::perms(0640));
  EXPECT_FALSE(SigningKey::Read(path));
  EXPECT_FALSE(SigningKey::Read(folder.File("none.sign")));
  EXPECT_EQ(SigningSecretPath("team/rover1.sec"), "team/rover1.sign");
}

TEST(SigningKeyTest, RejectsInvalidKeys) {
  EXPECT_TRUE(IsSigningKey(KeyOf(1).public_key()));
  EXPECT_FALSE(IsSigningKey(""));
  EXPECT_FALSE(IsSigningKey(std::string(40, '0'))) << "no point of the curve that has the right order";
}

TEST(KeyFingerprintTest, IsThePrefixOfTheSha256OfTheText) {
  const std::string key = "rq:rM>}U?@Lns47E1%kR.o@n%FcmmsL/@{H8]yf7";
  EXPECT_EQ(FingerprintOf(key), "84112785d1092a7effc25904531ada76");
  EXPECT_NE(FingerprintOf(KeyOf(1).public_key()), FingerprintOf(KeyOf(2).public_key()));
  EXPECT_EQ(FingerprintOf(""), "");
  EXPECT_EQ(FingerprintOf(key + "0"), "");
}

class RoleSignatureTest : public testing::Test {
 protected:
  RoleSignatureTest() {
    team_.set_team_id("00112233445566778899aabbccddeeff");
    for (const std::uint32_t id : {1, 2}) {
      proto::AgentConfig& agent = *team_.add_agents();
      agent.set_id(id);
      agent.set_signing_key(KeyOf(static_cast<std::uint8_t>(id)).public_key());
    }
    roles_.mutable_term()->set_number(7);
    roles_.mutable_term()->set_issuer(1);
    roles_.set_leader(2);
    roles_.set_follows("what was before");
    roles_.set_signature(KeyOf(1).Sign(SignedBytes(team_, roles_)));
  }

  proto::TeamConfig team_;
  proto::RoleAssignment roles_;
};

TEST_F(RoleSignatureTest, CoversItsIssuerAndEveryField) {
  EXPECT_TRUE(HasSigningKeys(team_));
  EXPECT_TRUE(IsSigned(team_, roles_));
  const auto spoilt = [this](auto spoil) {
    proto::RoleAssignment roles = roles_;
    spoil(roles);
    return IsSigned(team_, roles);
  };
  EXPECT_FALSE(spoilt([](auto& roles) { roles.set_leader(1); }));
  EXPECT_FALSE(spoilt([](auto& roles) { roles.set_survivor(1); }));
  EXPECT_FALSE(spoilt([](auto& roles) { roles.mutable_term()->set_number(8); }));
  EXPECT_FALSE(spoilt([](auto& roles) { roles.mutable_term()->set_issuer_epoch(8); }));
  EXPECT_FALSE(spoilt([](auto& roles) { roles.set_follows("another"); }));
  EXPECT_FALSE(spoilt([](auto& roles) { roles.set_timestamp_ns(1); }));
  EXPECT_FALSE(spoilt([](auto& roles) { roles.set_reason("another"); }));
  EXPECT_FALSE(spoilt([](auto& roles) { roles.mutable_term()->set_issuer(2); })) << "another's signature";
  EXPECT_FALSE(spoilt([](auto& roles) { roles.mutable_term()->set_issuer(9); }));
  EXPECT_FALSE(spoilt([](auto& roles) { roles.clear_signature(); }));
}

TEST_F(RoleSignatureTest, IsValidInOneTeamOnly) {
  team_.set_team_id("ffeeddccbbaa99887766554433221100");
  EXPECT_FALSE(IsSigned(team_, roles_));
}

TEST_F(RoleSignatureTest, IsRequiredIfEveryAgentHasAKey) {
  team_.mutable_agents(1)->clear_signing_key();
  EXPECT_FALSE(HasSigningKeys(team_));
  team_.mutable_agents(1)->set_signing_key(KeyOf(2).public_key());
  team_.set_insecure(true);
  EXPECT_FALSE(HasSigningKeys(team_));
}

TEST(RecordSignatureTest, IsValidForOneRecordOneKeyAndOneTeam) {
  proto::TeamConfig team;
  team.set_team_id(std::string(16, 't'));
  for (AgentId id = 1; id <= 2; ++id) {
    proto::AgentConfig& agent = *team.add_agents();
    agent.set_id(id);
    agent.set_signing_key(KeyOf(static_cast<std::uint8_t>(id)).public_key());
  }
  const RecordKey key{{1, 7, proto::MAP_QUARANTINE}, 3};
  proto::Record record;
  record.set_timestamp_ns(5);
  record.mutable_map_quarantine()->set_agent_id(2);
  EXPECT_FALSE(IsSigned(team, key, record));
  record.mutable_map_quarantine()->set_signature(KeyOf(1).Sign(SignedBytes(team, key, record)));
  EXPECT_TRUE(IsSigned(team, key, record));

  proto::Record changed = record;
  changed.set_timestamp_ns(6);
  EXPECT_FALSE(IsSigned(team, key, changed));
  for (const RecordKey& other :
       {RecordKey{{2, 7, proto::MAP_QUARANTINE}, 3}, RecordKey{{1, 8, proto::MAP_QUARANTINE}, 3},
        RecordKey{{1, 7, proto::MAP_QUARANTINE}, 4}, RecordKey{{3, 7, proto::MAP_QUARANTINE}, 3}}) {
    EXPECT_FALSE(IsSigned(team, other, record)) << ToString(other);
  }
  proto::TeamConfig another = team;
  another.set_team_id(std::string(16, 'u'));
  EXPECT_FALSE(IsSigned(another, key, record));
  proto::Record node;
  node.mutable_pose_graph_node();
  EXPECT_FALSE(IsSigned(team, key, node));
}

}  // namespace
}  // namespace moondb
