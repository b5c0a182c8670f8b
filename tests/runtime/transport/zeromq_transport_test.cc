#include "runtime/transport/zeromq_transport.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netdb.h>
#include <unistd.h>
#include <zmq.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "model/control_message.h"
#include "model/private_folder.h"
#include "proto/status.pb.h"
#include "runtime/team/curve_keys.h"
#include "runtime/team/team_config.h"
#include "runtime/transport/listen_address.h"
#include "runtime/transport/outbound.h"
#include "tests/free_port.h"
#include "tests/runtime/transport/transport_fixture.h"
#include "tests/temporary_folder.h"

namespace moondb {
namespace {

using ::testing::HasSubstr;

using ZeroMqTransportTest = TransportFixture;

TEST_F(ZeroMqTransportTest, CarriesMessagesBothWays) {
  Start(1);
  Start(2);
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  ASSERT_TRUE(ears_[2].WaitForPeer(1, true));
  const proto::Message there = Message(1, 2);
  ASSERT_EQ(transports_[1]->Send({2, "sync"}, there), SendResult::kAccepted);
  const OwnedMessage heard = ears_[2].Take();
  ASSERT_NE(heard, nullptr);
  EXPECT_EQ(heard->SerializeAsString(), there.SerializeAsString());
  ASSERT_EQ(transports_[2]->Send({1, "sync"}, Message(2, 1)), SendResult::kAccepted);
  ASSERT_NE(ears_[1].Take(), nullptr);

  const proto::PeerStatus status = Peer(1, 2);
  EXPECT_EQ(status.name(), "rover2");
  EXPECT_TRUE(status.is_connected());
  EXPECT_EQ(status.sent_messages(), 1);
  EXPECT_EQ(status.sent_bytes(), static_cast<double>(ToPeerFrame(there).size()));
  EXPECT_EQ(status.received_messages(), 1);
  EXPECT_GE(status.seconds_since_heard(), 0);
  EXPECT_LT(Peer(1, 3).seconds_since_heard(), 0);
}

// A message of the maximum size arrives. A message of one byte more is refused, and the link stays connected.
TEST_F(ZeroMqTransportTest, CarriesMessagesInOrderAndTheLongest) {
  Start(1);
  Start(2);
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  proto::Message longest = Message(1, 2, 250'000);
  longest.mutable_record_id()->append(kPeerMessageBytesMax - longest.ByteSizeLong(), 'x');
  ASSERT_EQ(longest.ByteSizeLong(), kPeerMessageBytesMax);
  proto::Message too_long = longest;
  too_long.mutable_record_id()->push_back('x');
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(transports_[1]->Send({2, "sync"}, too_long), SendResult::kTooLong);
    ASSERT_EQ(transports_[1]->Send({2, "sync"}, longest), SendResult::kAccepted);
    const OwnedMessage heard = ears_[2].Take();
    ASSERT_NE(heard, nullptr);
    EXPECT_EQ(heard->record_id().size(), longest.record_id().size());
  }
  EXPECT_EQ(Peer(1, 2).dropped_messages(), 3);
  EXPECT_EQ(Peer(1, 2).connects(), 1);
  for (std::size_t i = 1; i <= 100; ++i) {
    ASSERT_EQ(transports_[1]->Send({2, "sync"}, Message(1, 2, i)), SendResult::kAccepted);
  }
  for (std::size_t i = 1; i <= 100; ++i) ASSERT_EQ(ears_[2].Take()->record_id().size(), i);
}

TEST_F(ZeroMqTransportTest, ReportsThatAPeerIsAbsentOrUnknown) {
  Start(1);
  EXPECT_EQ(transports_[1]->Send({2, "sync"}, Message(1, 2)), SendResult::kUnreachable);
  EXPECT_EQ(transports_[1]->Send({9, "sync"}, Message(1, 9)), SendResult::kNoPeer);
  EXPECT_EQ(transports_[1]->Send({1, "sync"}, Message(1, 1)), SendResult::kNoPeer);
  EXPECT_EQ(transports_[1]->Send({kClients, "1"}, Message(1, 1)), SendResult::kUnreachable);
  EXPECT_FALSE(Peer(1, 2).is_connected());
  EXPECT_EQ(Peer(1, 2).dropped_messages(), 1);
}

TEST_F(ZeroMqTransportTest, ReachesAPeerAgainAfterItsRestart) {
  Start(1);
  for (int boot = 0; boot < 3; ++boot) {
    SCOPED_TRACE(boot);
    Start(2);
    ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
    ASSERT_TRUE(ears_[2].WaitForPeer(1, true));
    ASSERT_EQ(transports_[1]->Send({2, "sync"}, Message(1, 2)), SendResult::kAccepted);
    ASSERT_NE(ears_[2].Take(), nullptr);
    ASSERT_EQ(transports_[2]->Send({1, "sync"}, Message(2, 1)), SendResult::kAccepted);
    ASSERT_NE(ears_[1].Take(), nullptr);
    transports_.erase(2);
    ears_.erase(2);
    ASSERT_TRUE(ears_[1].WaitForPeer(2, false));
    EXPECT_EQ(transports_[1]->Send({2, "sync"}, Message(1, 2)), SendResult::kUnreachable);
  }
}

// Two processes have the same key if a robot's disk was copied. Each process numbers its own connections.
TEST_F(ZeroMqTransportTest, DetectsTwoProcessesWithOneKey) {
  Start(1);
  const RawDealer::Keys keys = KeysOf(2, 1);
  const auto connect = [&](std::uint32_t link_number) {
    RawDealer process(AddressOf(1), &keys);
    process.Send(OnLink(link_number, ToPeerFrame(Message(2, 1))));
    ASSERT_NE(ears_[1].Take(), nullptr);
  };
  for (const std::uint32_t link_number : {1000u, 1001u, 5u, 6u}) connect(link_number);
  EXPECT_FALSE(Peer(1, 2).has_two_processes()) << "agent 2 was started again";
  for (const std::uint32_t link_number : {1002u, 7u, 1003u, 8u}) connect(link_number);
  EXPECT_FALSE(Peer(1, 2).has_two_processes()) << "two restarts could cause as many returns";
  connect(1004);
  EXPECT_TRUE(Peer(1, 2).has_two_processes());
}

TEST_F(ZeroMqTransportTest, RefusesAKeyFromOutsideTheTeam) {
  Start(1);
  RawDealer::Keys keys = KeysOf(2, 1);
  keys.own = MakeCurveKeys().value();
  RawDealer stranger(AddressOf(1), &keys);
  EXPECT_EQ(stranger.NextEvent(), ZMQ_EVENT_HANDSHAKE_FAILED_AUTH);
  EXPECT_EQ(ears_[1].waiting(), 0u);
}

TEST_F(ZeroMqTransportTest, RefusesAnAgentThatHasLeftAndDoesNotConnectToIt) {
  Start(2);
  team_.config.mutable_agents(1)->set_left(true);  // Rover2 itself still has the old team file.
  Start(1);
  Start(3);
  ASSERT_TRUE(ears_[1].WaitForPeer(3, true));
  RawDealer::Keys keys = KeysOf(2, 1);
  RawDealer gone(AddressOf(1), &keys);
  EXPECT_EQ(gone.NextEvent(), ZMQ_EVENT_HANDSHAKE_FAILED_AUTH);
  EXPECT_GE(transports_[1]->Listener().unknown_agent_keys(), 1);
  EXPECT_EQ(transports_[1]->Peers().size(), 1u) << "rover3 alone";
  EXPECT_EQ(transports_[1]->Send({2, "sync"}, Message(1, 2)), SendResult::kNoPeer);
}

TEST_F(ZeroMqTransportTest, DoesNotTrustAPeerWithTheWrongKey) {
  Start(1);
  // An attacker listens at rover2's address with a key of its own.
  std::filesystem::remove(team_.folder / "rover2.pub");
  std::filesystem::remove(team_.folder / "rover2.sec");
  const CurveKeys other = MakeCurveKeys().value();
  std::ofstream(team_.folder / "rover2.pub") << other.public_key;
  std::ofstream(team_.folder / "rover2.sec") << other.secret_key;
  std::filesystem::permissions(team_.folder / "rover2.sec", std::filesystem::perms(0600));
  Start(2);
  // Rover3 reads the new key and connects to rover1 and rover2. By then, rover2 has had time to connect to rover1.
  Start(3);
  ASSERT_TRUE(ears_[3].WaitForPeer(2, true));
  ASSERT_TRUE(ears_[3].WaitForPeer(1, true));
  EXPECT_FALSE(Peer(1, 2).is_connected());
  EXPECT_FALSE(Peer(2, 1).is_connected());
  EXPECT_EQ(transports_[1]->Send({2, "sync"}, Message(1, 2)), SendResult::kUnreachable);
}

TEST_F(ZeroMqTransportTest, DropsAndCountsMessagesThatClaimAnotherSender) {
  Start(1);
  Start(2);
  ASSERT_TRUE(ears_[2].WaitForPeer(1, true));
  ASSERT_EQ(transports_[2]->Send({1, "sync"}, Message(/*hop_sender=*/3, 1)), SendResult::kAccepted);
  ASSERT_EQ(transports_[2]->Send({1, "sync"}, Message(2, 1)), SendResult::kAccepted);
  EXPECT_EQ(ears_[1].Take()->hop_sender(), 2u);
  EXPECT_EQ(Peer(1, 2).rejected_messages(), 1);
  EXPECT_EQ(Peer(1, 2).received_messages(), 1);
  EXPECT_EQ(Peer(1, 3).received_messages(), 0);
}

TEST_F(ZeroMqTransportTest, AcceptsPeersThatClaimTheSameRoutingId) {
  Start(1);
  const RawDealer::Keys keys_of_2 = KeysOf(2, 1);
  const RawDealer::Keys keys_of_3 = KeysOf(3, 1);
  RawDealer first(AddressOf(1), &keys_of_2, "2");
  first.Send(OnLink(7, ToPeerFrame(Message(2, 1))));
  ASSERT_NE(ears_[1].Take(), nullptr);
  RawDealer second(AddressOf(1), &keys_of_3, "2");
  second.Send(OnLink(7, ToPeerFrame(Message(3, 1))));
  const OwnedMessage heard = ears_[1].Take();
  ASSERT_NE(heard, nullptr);
  EXPECT_EQ(heard->hop_sender(), 3u);
  first.Send(OnLink(7, ToPeerFrame(Message(2, 1))));
  EXPECT_NE(ears_[1].Take(), nullptr);
}

// The kernel gives the second connection the file descriptor of the first one. Only the link numbers differ.
TEST_F(ZeroMqTransportTest, CountsBytesPerConnectionThoughADescriptorIsReused) {
  Start(1);
  const RawDealer::Keys keys = KeysOf(2, 1);
  auto first = std::make_unique<RawDealer>(AddressOf(1), &keys);
  first->Send(OnLink(7, ToPeerFrame(Message(2, 1, 1000))));
  ASSERT_NE(ears_[1].Take(), nullptr);
  first.reset();
  RawDealer second(AddressOf(1), &keys);
  proto::Message report = Message(2, 1);
  report.mutable_link_report()->set_reported_link(1);
  second.Send(OnLink(8, ToPeerFrame(report)));
  second.Send(OnLink(8, ToPeerFrame(Message(2, 1))));
  ASSERT_NE(ears_[1].Take(), nullptr);
  EXPECT_EQ(Peer(1, 2).refused_reports(), 0) << "the report came over the newest connection";
  EXPECT_EQ(Peer(1, 2).received_messages(), 2);
}

TEST_F(ZeroMqTransportTest, ClosesAnOutgoingLinkOverWhichThePeerSends) {
  MakeTeam(/*is_insecure=*/true);
  for (int i = 0; i < 2; ++i) {
    team_.config.mutable_agents(i)->set_address("tcp://127.0.0.1:" + std::to_string(FreePort()));
  }
  Start(1);
  RawRouter peer(AddressOf(2));
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  const std::string route = peer.Receive().route;
  ASSERT_FALSE(route.empty());
  peer.Send(route, std::string(10'000, 'x'));
  EXPECT_TRUE(Peer(1, 2).is_connected());
  for (int i = 0; i < 3; ++i) peer.Send(route, std::string(30'000, 'x'));
  ASSERT_TRUE(ears_[1].WaitForPeer(2, false));
  EXPECT_EQ(Peer(1, 2).cut_for_bytes(), 1);
}

TEST_F(ZeroMqTransportTest, DropsAndCountsDamagedFrames) {
  Start(1);
  const RawDealer::Keys keys = KeysOf(2, 1);
  RawDealer peer(AddressOf(1), &keys);
  peer.Send("\xff\xff\xff");
  peer.Send("one", /*has_more=*/true);
  peer.Send("two");
  peer.Send("");
  peer.Send(OnLink(7, ToPeerFrame({})));  // This empty message has hop_sender 0, which is no agent.
  peer.Send(OnLink(7, ToPeerFrame(Message(2, 1))));
  ASSERT_NE(ears_[1].Take(), nullptr);
  EXPECT_EQ(Peer(1, 2).rejected_messages(), 4);
  EXPECT_EQ(Peer(1, 2).received_messages(), 1);
}

TEST_F(ZeroMqTransportTest, DropsMessagesThatAreOnlyAllowedWithinAnAgent) {
  Start(1);
  const RawDealer::Keys keys = KeysOf(2, 1);
  RawDealer peer(AddressOf(1), &keys);
  proto::Message message = Message(2, 1);
  message.mutable_timer()->set_kind(1);
  peer.Send(OnLink(7, ToPeerFrame(message)));
  message.mutable_save_roles_request();
  peer.Send(OnLink(7, ToPeerFrame(message)));
  message.mutable_hello();
  peer.Send(OnLink(7, ToPeerFrame(message)));
  EXPECT_TRUE(ears_[1].Take()->has_hello());
  EXPECT_EQ(Peer(1, 2).rejected_messages(), 2);
}

TEST_F(ZeroMqTransportTest, BoundsTheSizeOfMessagesAtBothEnds) {
  ZeroMqTransport::Options options;
  options.frame_bytes_max = 1000;
  Start(1, options);
  Start(2, options);
  ASSERT_TRUE(ears_[2].WaitForPeer(1, true));
  EXPECT_EQ(transports_[2]->Send({1, "sync"}, Message(2, 1, 1001)), SendResult::kTooLong);
  EXPECT_EQ(Peer(2, 1).dropped_messages(), 1);

  const RawDealer::Keys keys = KeysOf(3, 1);
  RawDealer peer(AddressOf(1), &keys);
  EXPECT_EQ(peer.NextEvent(), ZMQ_EVENT_HANDSHAKE_SUCCEEDED);
  peer.Send(OnLink(7, ToPeerFrame(Message(3, 1, 2000))));
  EXPECT_EQ(peer.NextEvent(), ZMQ_EVENT_DISCONNECTED);
  EXPECT_EQ(ears_[1].waiting(), 0u);
}

TEST_F(ZeroMqTransportTest, ReportsThatThePeerIsTooSlow) {
  ZeroMqTransport::Options options;
  options.outbox.bytes_max = 100'000;
  Start(1, options);
  // Agent 2 does not read: until the test unlocks `gate`, the delivery of a message blocks its transport's thread.
  std::mutex gate;
  std::unique_lock closed(gate);
  ZeroMqTransport::Options slow_options;
  slow_options.self = 2;
  auto slow = ZeroMqTransport::Create(
      team_.config, team_.folder, slow_options, [&](OwnedMessage) { const std::lock_guard lock(gate); },
      [](AgentId, bool) {});
  ASSERT_TRUE(slow);
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  SendResult result = SendResult::kAccepted;
  int accepted = 0;
  for (; accepted < 10'000 && result == SendResult::kAccepted; ++accepted) {
    result = transports_[1]->Send({2, "sync"}, Message(1, 2, 40'000));
  }
  EXPECT_EQ(result, SendResult::kFull);
  EXPECT_GE(accepted, 3);
  EXPECT_EQ(Peer(1, 2).dropped_messages(), 1);
  closed.unlock();
  slow->reset();
}

TEST_F(ZeroMqTransportTest, AnswersClientsByTheirConnection) {
  ZeroMqTransport::Options options;
  options.client_endpoint = ClientEndpointHere();
  Start(1, options);
  RawDealer first(options.client_endpoint);
  RawDealer second(options.client_endpoint);

  // The message claims another sender and receiver. The transport must treat it as a client's message to the gateway.
  proto::Message request = Message(/*hop_sender=*/2, /*to=*/3);
  request.set_agent_id(2);
  request.set_source_actor("storage");
  request.set_sql("drop table records");
  request.set_control_request("status");
  request.set_request_id(1);
  first.Send(request.SerializeAsString());
  const OwnedMessage from_first = ears_[1].Take();
  ASSERT_NE(from_first, nullptr);
  EXPECT_EQ(from_first->hop_sender(), kClients);
  EXPECT_EQ(from_first->agent_id(), 1u);
  EXPECT_EQ(from_first->destination_id(), 1u);
  EXPECT_EQ(from_first->destination_actor(), actor_name::kGateway);
  EXPECT_EQ(from_first->request_id(), 1u);
  EXPECT_EQ(from_first->sql(), "");
  EXPECT_EQ(from_first->control_request(), "status");

  request.set_request_id(2);
  second.Send(request.SerializeAsString());
  const OwnedMessage from_second = ears_[1].Take();
  ASSERT_NE(from_second, nullptr);
  EXPECT_NE(from_first->source_actor(), from_second->source_actor());

  for (const OwnedMessage* asked : {&from_second, &from_first}) {
    proto::Message reply;
    reply.set_request_id((*asked)->request_id());
    ASSERT_EQ(transports_[1]->Send({kClients, (*asked)->source_actor()}, reply), SendResult::kAccepted);
  }
  proto::Message heard;
  ASSERT_TRUE(heard.ParseFromString(first.Receive()));
  EXPECT_EQ(heard.request_id(), 1u);
  ASSERT_TRUE(heard.ParseFromString(second.Receive()));
  EXPECT_EQ(heard.request_id(), 2u);
}

TEST_F(ZeroMqTransportTest, ReportsToAClientThatItsReplyIsTooLarge) {
  ZeroMqTransport::Options options;
  options.client_endpoint = ClientEndpointHere();
  options.client_message_bytes_max = 1000;
  Start(1, options);
  RawDealer client(options.client_endpoint);
  proto::Message request = Message(0, 0);
  request.set_request_id(7);
  client.Send(request.SerializeAsString());
  proto::Message reply = Message(1, 1, 2000);
  reply.set_request_id(7);
  EXPECT_EQ(transports_[1]->Send({kClients, ears_[1].Take()->source_actor()}, reply), SendResult::kFull);
  proto::Message heard;
  ASSERT_TRUE(heard.ParseFromString(client.Receive()));
  EXPECT_EQ(heard.request_id(), 7u);
  const Result<void> answered = CheckControlReply(heard);
  ASSERT_FALSE(answered);
  EXPECT_EQ(answered.error().code, ErrorCode::kFull);
  EXPECT_THAT(answered.error().text, HasSubstr("more than the 1000 of a message"));
}

TEST_F(ZeroMqTransportTest, IgnoresAClientThatSendsAsATransport) {
  ZeroMqTransport::Options options;
  options.client_endpoint = ClientEndpointHere();
  Start(1, options);
  RawDealer client(options.client_endpoint);
  proto::Message report = Message(2, 1);
  report.mutable_link_report()->set_reported_link(1);
  client.Send(report.SerializeAsString());
  client.Send(Message(0, 0).SerializeAsString());
  EXPECT_FALSE(ears_[1].Take()->has_link_report());
}

TEST_F(ZeroMqTransportTest, AClientThatLeftDelaysNoOther) {
  ZeroMqTransport::Options options;
  options.client_endpoint = ClientEndpointHere();
  Start(1, options);
  std::string gone;
  {
    RawDealer client(options.client_endpoint);
    client.Send(Message(0, 0).SerializeAsString());
    gone = ears_[1].Take()->source_actor();
  }
  RawDealer client(options.client_endpoint);
  client.Send(Message(0, 0).SerializeAsString());
  const OwnedMessage asked = ears_[1].Take();
  (void)transports_[1]->Send({kClients, gone}, Message(1, 1));
  ASSERT_EQ(transports_[1]->Send({kClients, asked->source_actor()}, Message(1, 1)), SendResult::kAccepted);
  EXPECT_EQ(client.Receive(), Message(1, 1).SerializeAsString());
}

TEST_F(ZeroMqTransportTest, ReportsThatAnAddressIsInUse) {
  ZeroMqTransport::Options options;
  options.client_endpoint = ClientEndpointHere();
  Start(1, options);
  const auto again = Create(1, options);
  ASSERT_FALSE(again);
  EXPECT_EQ(again.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(again.error().text, "cannot listen on " + AddressOf(1) + ": Address already in use");

  options.client_endpoint = ClientEndpointHere();
  const auto other = Create(2, options);
  ASSERT_FALSE(other);
  EXPECT_EQ(other.error().text, "cannot listen on " + options.client_endpoint + ": Address already in use");
}

TEST_F(ZeroMqTransportTest, ReplacesASocketThatWasLeftBehind) {
  ZeroMqTransport::Options options;
  options.client_endpoint = ClientEndpointHere();
  ASSERT_TRUE(MakePrivateFolder(folder_ / "run"));
  const std::string path = options.client_endpoint.substr(6);
  {
    // The state after kill -9: the socket file exists, but no process listens.
    void* context = zmq_ctx_new();
    void* socket = zmq_socket(context, ZMQ_ROUTER);
    ASSERT_EQ(zmq_bind(socket, options.client_endpoint.c_str()), 0);
    std::filesystem::create_hard_link(path, path + ".kept");
    zmq_close(socket);
    zmq_ctx_term(context);
    std::filesystem::rename(path + ".kept", path);
  }
  ASSERT_TRUE(std::filesystem::exists(path));
  EXPECT_TRUE(Create(1, options));
}

TEST_F(ZeroMqTransportTest, RemovesTheSocketOfClientsWhenItEnds) {
  ZeroMqTransport::Options options;
  options.client_endpoint = ClientEndpointHere();
  Start(1, options);
  ASSERT_TRUE(std::filesystem::exists(options.client_endpoint.substr(6)));
  transports_.clear();
  EXPECT_FALSE(std::filesystem::exists(options.client_endpoint.substr(6)));
}

TEST_F(ZeroMqTransportTest, RefusesAFolderOfClientsThatOthersCanReach) {
  std::filesystem::create_directory(folder_ / "run");
  std::filesystem::permissions(folder_ / "run", std::filesystem::perms(0755));
  ZeroMqTransport::Options options;
  options.client_endpoint = ClientEndpointHere();
  const auto transport = Create(1, options);
  ASSERT_FALSE(transport);
  EXPECT_EQ(transport.error().code, ErrorCode::kInvalid);
}

TEST_F(ZeroMqTransportTest, ReportsErrorsInItsOwnKeys) {
  ZeroMqTransport::Options options;
  options.secret_key_file = (team_.folder / "rover2.sec").string();
  EXPECT_THAT(Create(1, options).error().text, HasSubstr("rover2.sec: does not fit the public key"));
  options.secret_key_file = (team_.folder / "none.sec").string();
  EXPECT_THAT(Create(1, options).error().text, HasSubstr("none.sec: no such file"));
  std::filesystem::permissions(team_.folder / "rover1.sec", std::filesystem::perms(0644));
  EXPECT_THAT(Create(1).error().text, HasSubstr("others can read this secret"));
  EXPECT_EQ(Create(1).error().code, ErrorCode::kInvalid);
}

TEST_F(ZeroMqTransportTest, KnowsItsTeamWithoutKeys) {
  MakeTeam(/*is_insecure=*/true);
  Start(1);
  Start(2);
  ASSERT_TRUE(ears_[2].WaitForPeer(1, true));
  ASSERT_EQ(transports_[2]->Send({1, "sync"}, Message(/*hop_sender=*/9, 1)), SendResult::kAccepted);
  ASSERT_EQ(transports_[2]->Send({1, "sync"}, Message(/*hop_sender=*/1, 1)), SendResult::kAccepted);
  ASSERT_EQ(transports_[2]->Send({1, "sync"}, Message(2, 1)), SendResult::kAccepted);
  EXPECT_EQ(ears_[1].Take()->hop_sender(), 2u);
  EXPECT_EQ(Peer(1, 2).rejected_messages(), 2);
}

TEST_F(ZeroMqTransportTest, SendsFromManyThreads) {
  Start(1);
  Start(2);
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  constexpr int kThreads = 4;
  constexpr int kMessages = 200;
  std::vector<std::thread> senders;
  for (int i = 0; i < kThreads; ++i) {
    senders.emplace_back([&] {
      for (int j = 0; j < kMessages; ++j) (void)transports_[1]->Send({2, "sync"}, Message(1, 2));
    });
  }
  for (std::thread& sender : senders) sender.join();
  for (int i = 0; i < kThreads * kMessages; ++i) ASSERT_NE(ears_[2].Take(), nullptr);
}

// The agent's address is not one of this computer, as behind NAT: others reach it through the forwarded port.
TEST_F(ZeroMqTransportTest, ListensAtAnAddressOfItsOwn) {
  const std::string port = std::to_string(FreePort());
  proto::AgentConfig& agent = *team_.config.mutable_agents(1);
  agent.set_address("tcp://192.0.2.1:7400");
  agent.set_listen("tcp://0.0.0.0:" + port);
  Start(2);
  agent.set_address("tcp://127.0.0.1:" + port);
  Start(1);
  ASSERT_TRUE(ears_[1].WaitForPeer(2, true));
  ASSERT_EQ(transports_[1]->Send({2, "sync"}, Message(1, 2)), SendResult::kAccepted);
  ASSERT_NE(ears_[2].Take(), nullptr);
}

TEST(ListenAddressTest, ResolvesNamesToNumericAddresses) {
  if (gethostbyname("localhost") == nullptr) GTEST_SKIP() << "this machine does not know the name localhost";
  EXPECT_EQ(NumericEndpoint("tcp://localhost:7400").value(), "tcp://127.0.0.1:7400");
}

TEST(ListenAddressTest, KeepsNumericAddressesAndPaths) {
  EXPECT_EQ(NumericEndpoint("tcp://[::1]:7400").value(), "tcp://[::1]:7400");
  EXPECT_EQ(NumericEndpoint("ipc:///tmp/x").value(), "ipc:///tmp/x");
}

TEST(ListenAddressTest, KeepsAFileThatIsNoSocket) {
  const TemporaryFolder folder;
  const std::string path = folder.File("file");
  std::ofstream(path) << "precious";
  EXPECT_EQ(ClaimIpcPath("ipc://" + path).error().code, ErrorCode::kInvalid);
  EXPECT_TRUE(std::filesystem::remove(path));
}

}  // namespace
}  // namespace moondb
