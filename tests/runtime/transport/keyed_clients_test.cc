// Tests clients with CURVE keys over TCP, with real transports and raw sockets in one process.
#include <gmock/gmock.h>

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "model/control_message.h"
#include "model/text.h"
#include "proto/control.pb.h"
#include "runtime/team/client_list.h"
#include "tests/free_port.h"
#include "tests/runtime/transport/transport_fixture.h"

namespace moondb {
namespace {

class KeyedClientsTest : public TransportFixture {
 protected:
  KeyedClientsTest() {
    ListClients({{"anna", anna_, proto::CLIENT_RIGHTS_VIEW}});
    address_ = "tcp://127.0.0.1:" + std::to_string(FreePort());
    team_.config.mutable_agents(0)->set_client_address(address_);
  }

  struct Listed {
    std::string name;
    CurveKeys keys;
    proto::ClientRights rights;
  };
  void ListClients(const std::vector<Listed>& listed) {
    proto::ClientList list;
    for (const Listed& one : listed) {
      proto::ListedClient& client = *list.add_clients();
      client.set_name(one.name);
      client.set_key(one.keys.public_key);
      client.set_rights(one.rights);
    }
    ASSERT_TRUE(WriteTextFile(clients_file_, ClientListText(list, "")).has_value());
  }

  ZeroMqTransport& StartWithClients() {
    ZeroMqTransport::Options options;
    options.client_endpoint = ClientEndpointHere();
    options.clients_file = clients_file_;
    return Start(1, std::move(options));
  }

  RawDealer::Keys With(const CurveKeys& own) const {
    return {ReadPublicKey(team_.folder / team_.config.agents(0).key()).value(), own};
  }

  // Sends a request in which the client claims the name `operator` and the right `command`. Returns the message that
  // agent 1's transport delivers.
  OwnedMessage HeardOf(RawDealer& client) {
    proto::ControlRequest status;
    status.mutable_status();
    proto::Message request = MessageOf(status);
    request.set_client_rights(proto::CLIENT_RIGHTS_COMMAND);
    request.set_client_name("operator");
    client.Send(request.SerializeAsString());
    return ears_[1].Take();
  }

  const std::filesystem::path clients_file_ = folder_ / "clients.yaml";
  const CurveKeys anna_ = MakeCurveKeys().value();
  std::string address_;
};

TEST_F(KeyedClientsTest, AListedKeyIsAdmittedWithItsNameAndRights) {
  ZeroMqTransport& transport = StartWithClients();
  const RawDealer::Keys keys = With(anna_);
  RawDealer client(address_, &keys);
  RawDealer own(ClientEndpointHere());
  const OwnedMessage heard = HeardOf(client);
  ASSERT_NE(heard, nullptr);
  EXPECT_EQ(heard->hop_sender(), kClients);
  EXPECT_EQ(heard->client_name(), "anna");
  EXPECT_EQ(heard->client_rights(), proto::CLIENT_RIGHTS_VIEW);
  const OwnedMessage of_user = HeardOf(own);
  ASSERT_NE(of_user, nullptr);
  EXPECT_EQ(of_user->client_name(), "");
  EXPECT_EQ(of_user->client_rights(), proto::CLIENT_RIGHTS_COMMAND);

  for (const OwnedMessage* asked : {&heard, &of_user}) {
    proto::Message reply;
    reply.set_record_id((*asked)->source_actor());
    ASSERT_EQ(transport.Send({kClients, (*asked)->source_actor()}, reply), SendResult::kAccepted);
  }
  EXPECT_THAT(client.Receive(), testing::HasSubstr(heard->source_actor()));
  EXPECT_THAT(own.Receive(), testing::HasSubstr(of_user->source_actor()));
  EXPECT_NE(heard->source_actor(), of_user->source_actor());
}

TEST_F(KeyedClientsTest, AnUnknownKeyAnAgentsKeyAndNoKeyAreRefused) {
  ZeroMqTransport& transport = StartWithClients();
  const RawDealer::Keys unknown = With(MakeCurveKeys().value());
  RawDealer stranger(address_, &unknown);
  EXPECT_EQ(stranger.NextEvent(), ZMQ_EVENT_HANDSHAKE_FAILED_AUTH);
  const RawDealer::Keys of_agent = KeysOf(2, 1);
  RawDealer agent(address_, &of_agent);
  EXPECT_EQ(agent.NextEvent(), ZMQ_EVENT_HANDSHAKE_FAILED_AUTH);
  RawDealer without(address_);
  EXPECT_NE(without.NextEvent(), ZMQ_EVENT_HANDSHAKE_SUCCEEDED);
  // The port of agents does not accept a client's key either.
  const RawDealer::Keys keys = With(anna_);
  RawDealer client(AddressOf(1), &keys);
  EXPECT_EQ(client.NextEvent(), ZMQ_EVENT_HANDSHAKE_FAILED_AUTH);
  EXPECT_EQ(ears_[1].waiting(), 0u);
  EXPECT_EQ(transport.Listener().unknown_client_keys(), 2) << "no key is not a key";
}

TEST_F(KeyedClientsTest, ARevokedKeyLosesItsRightsAndItsReplacementIsAdmitted) {
  StartWithClients();
  const RawDealer::Keys keys = With(anna_);
  RawDealer client(address_, &keys);
  ASSERT_NE(HeardOf(client), nullptr);
  const CurveKeys next = MakeCurveKeys().value();
  ListClients({{"anna", next, proto::CLIENT_RIGHTS_COMMAND}});
  // The agent reads the client list at most once per second.
  proto::ClientRights rights = proto::CLIENT_RIGHTS_VIEW;
  for (int i = 0; i < 600 && rights != proto::CLIENT_RIGHTS_NONE; ++i) {
    const OwnedMessage heard = HeardOf(client);
    ASSERT_NE(heard, nullptr);
    rights = heard->client_rights();
    if (rights != proto::CLIENT_RIGHTS_NONE) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  EXPECT_EQ(rights, proto::CLIENT_RIGHTS_NONE);
  proto::Message large;
  large.set_control_request(std::string(100'000, 'x'));
  client.Send(large.SerializeAsString());  // The agent drops this large request without parsing it.
  const OwnedMessage short_one = HeardOf(client);
  ASSERT_NE(short_one, nullptr);
  EXPECT_LT(short_one->control_request().size(), 100u);
  RawDealer again(address_, &keys);
  EXPECT_EQ(again.NextEvent(), ZMQ_EVENT_HANDSHAKE_FAILED_AUTH);
  const RawDealer::Keys replaced = With(next);
  RawDealer with_next(address_, &replaced);
  const OwnedMessage heard = HeardOf(with_next);
  ASSERT_NE(heard, nullptr);
  EXPECT_EQ(heard->client_name(), "anna");
  EXPECT_EQ(heard->client_rights(), proto::CLIENT_RIGHTS_COMMAND);
}

TEST_F(KeyedClientsTest, AConnectionThatChoseItsRoutingIdIsIgnoredAndCut) {
  ZeroMqTransport& transport = StartWithClients();
  const RawDealer::Keys keys = With(anna_);
  int cut = 0;
  // The last of these routing ids has the form of the ids that the agent assigns.
  for (const std::string& claimed : {std::string("anna"), std::string("\0abc", 4), std::string("\0abcd", 5)}) {
    SCOPED_TRACE(++cut);
    RawDealer client(address_, &keys, claimed);
    ASSERT_EQ(client.NextEvent(), ZMQ_EVENT_HANDSHAKE_SUCCEEDED);
    client.Send("request");
    EXPECT_EQ(client.NextEvent(), ZMQ_EVENT_DISCONNECTED);
    EXPECT_EQ(transport.Listener().cut_for_claimed_id(), cut);
  }
  RawDealer honest(address_, &keys);
  EXPECT_NE(HeardOf(honest), nullptr);
  EXPECT_EQ(ears_[1].waiting(), 0u);
}

TEST_F(KeyedClientsTest, AKeyHasFifteenConnectionsAndTheNextWaitsUntilOneEnds) {
  ZeroMqTransport& transport = StartWithClients();
  const RawDealer::Keys keys = With(anna_);
  std::vector<std::unique_ptr<RawDealer>> standing;
  for (int i = 0; i < 15; ++i) {
    standing.push_back(std::make_unique<RawDealer>(address_, &keys));
    ASSERT_EQ(standing.back()->NextEvent(), ZMQ_EVENT_HANDSHAKE_SUCCEEDED);
    if (i % 2 != 0) continue;  // This connection stays silent.
    ASSERT_NE(HeardOf(*standing.back()), nullptr);
  }
  RawDealer next(address_, &keys);
  EXPECT_NE(next.NextEvent(), ZMQ_EVENT_HANDSHAKE_SUCCEEDED);
  EXPECT_GE(transport.Listener().deferred_client_handshakes(), 1);
  standing.pop_back();
  while (next.NextEvent() != ZMQ_EVENT_HANDSHAKE_SUCCEEDED) {
    // Waits until libzmq's retry of the handshake succeeds.
  }
  for (const auto& client : standing) EXPECT_NE(HeardOf(*client), nullptr) << "an idle client is not cut";
}

TEST_F(KeyedClientsTest, StartsWithoutClientsIfTheListIsInvalid) {
  ASSERT_TRUE(WriteTextFile(clients_file_, "clients: 5\n").has_value());
  StartWithClients();
  const RawDealer::Keys keys = With(anna_);
  RawDealer client(address_, &keys);
  EXPECT_EQ(client.NextEvent(), ZMQ_EVENT_HANDSHAKE_FAILED_AUTH);
  RawDealer own(ClientEndpointHere());
  EXPECT_NE(HeardOf(own), nullptr);
}

TEST_F(KeyedClientsTest, DoesNotStartWithAnAddressInUse) {
  ZeroMqTransport::Options options;
  options.clients_file = clients_file_;
  Start(1, options);
  team_.config.mutable_agents(1)->set_client_address(address_);
  const auto taken = Create(2, options);
  ASSERT_FALSE(taken);
  EXPECT_EQ(taken.error().code, ErrorCode::kUnavailable);
}

}  // namespace
}  // namespace moondb
