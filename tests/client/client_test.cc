#include "client/client.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <pthread.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <csignal>
#include <cstring>
#include <thread>

#include "client/orders.h"
#include "client/record_feed.h"
#include "model/team_id.h"
#include "proto/control.pb.h"
#include "proto/types.pb.h"
#include "tests/client/fake_agent.h"

namespace moondb {
namespace {

using std::chrono::milliseconds;
using testing::HasSubstr;

std::string Frame(const proto::ClientMessage& request, const proto::ControlReply& reply) {
  proto::ClientMessage message;
  message.set_request_id(request.request_id());
  *message.mutable_control_reply() = reply;
  return message.SerializeAsString();
}

std::unique_ptr<Client> ConnectTo(const FakeAgent& agent, Client::Options options = {}) {
  auto client = Client::Connect(agent.endpoint(), "rover1", options);
  EXPECT_TRUE(client.has_value()) << ToString(client.error());
  return std::move(*client);
}

TEST(ClientTest, ReportsAtOnceThatAnAgentIsNotRunning) {
  const auto start = std::chrono::steady_clock::now();
  const auto client = Client::Connect("ipc:///tmp/moondb-no-such-folder/rover1", "rover1", {});
  ASSERT_FALSE(client.has_value());
  EXPECT_EQ(client.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(client.error().text, "agent rover1 is not running (no socket /tmp/moondb-no-such-folder/rover1)");
  EXPECT_LT(std::chrono::steady_clock::now() - start, milliseconds(500));
}

TEST(ClientTest, ReportsADeadAgentThatLeftItsSocket) {
  FakeAgent agent([](const proto::ClientMessage&) { return std::vector<std::string>{}; });
  const std::string path = agent.endpoint().substr(6);
  agent.Stop();
  // Create a socket file on which no process listens, like the file that a killed agent leaves behind.
  const int left = ::socket(AF_UNIX, SOCK_STREAM, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  path.copy(address.sun_path, sizeof(address.sun_path) - 1);
  ::unlink(path.c_str());
  ASSERT_EQ(::bind(left, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  ::close(left);

  const auto client = Client::Connect(agent.endpoint(), "rover1", {});
  ASSERT_FALSE(client.has_value());
  EXPECT_EQ(client.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(client.error().text, HasSubstr("no process listens"));
}

TEST(ClientTest, ReturnsTheReplyOrTheAgentsError) {
  FakeAgent agent([](const proto::ClientMessage& request) {
    proto::ControlReply reply;
    if (request.control_request().has_status()) {
      reply.mutable_status()->set_name("rover1");
    } else {
      reply.mutable_error()->set_code(proto::ERROR_CODE_REFUSED);
      reply.mutable_error()->set_text("not the leader");
    }
    return std::vector{Frame(request, reply)};
  });
  auto client = ConnectTo(agent);
  const auto status = client->Status();
  ASSERT_TRUE(status.has_value()) << ToString(status.error());
  EXPECT_EQ(status->name(), "rover1");
  const auto optimized = client->Optimize();
  ASSERT_FALSE(optimized.has_value());
  EXPECT_EQ(optimized.error().code, ErrorCode::kRefused);
  EXPECT_EQ(optimized.error().text, "not the leader");
}

TEST(ClientTest, RefusesAnAnswerOfAnotherTeamAndSendsItsOwnTeam) {
  std::string asked_for;
  std::string answers_for = TeamIdBytes("00112233445566778899aabbccddeeff");
  FakeAgent agent([&](const proto::ClientMessage& request) {
    asked_for = request.control_request().team_id();
    proto::ControlReply reply;
    reply.mutable_status()->set_name("rover1");
    reply.set_team_id(answers_for);
    reply.set_config_hash(7);
    return std::vector{Frame(request, reply)};
  });
  Client::Options options;
  options.team_id = "00112233445566778899aabbccddeeff";
  std::vector<std::uint64_t> hashes;
  options.on_config_hash = [&hashes](std::uint64_t hash) { hashes.push_back(hash); };
  auto client = ConnectTo(agent, options);
  EXPECT_TRUE(client->Status().has_value());
  EXPECT_EQ(asked_for, answers_for);
  EXPECT_THAT(hashes, testing::ElementsAre(7));
  for (const std::string other : {"0123456789abcdef", ""}) {
    answers_for = other;
    const auto status = client->Status();
    ASSERT_FALSE(status.has_value());
    EXPECT_EQ(status.error().code, ErrorCode::kRefused);
  }
  EXPECT_TRUE(ConnectTo(agent)->Status().has_value()) << "a client that names no team";
}

// --- Requests that last until their work is done ---

proto::ControlReply ErrorReply(proto::ErrorCode code, const std::string& text, const std::string& field = "") {
  proto::ControlReply reply;
  reply.mutable_error()->set_code(code);
  reply.mutable_error()->set_text(text);
  reply.mutable_error()->set_field(field);
  return reply;
}

// A fake leader. Its `steps`-th progress report says that the order to share is complete.
class SharingAgent {
 public:
  explicit SharingAgent(int steps) : steps_(steps) {}

  std::vector<std::string> Answer(const proto::ClientMessage& message) {
    const proto::ControlRequest& request = message.control_request();
    proto::ControlReply reply;
    if (request.has_status()) {
      reply.mutable_status()->set_agent_id(1);
      reply.mutable_status()->mutable_roles()->set_leader(leader);
    } else if (request.has_share()) {
      ++orders;
      last_wait_s = request.share().wait_s();
      if (errors > 0) {
        --errors;
        return {Frame(message, ErrorReply(proto::ERROR_CODE_REFUSED, "leadership moved", "expected_term"))};
      }
      reply.mutable_share()->set_order(5);
      if (last_wait_s > 0) reply.mutable_share()->mutable_progress()->set_is_complete(true);
    } else if (request.has_share_progress()) {
      proto::ShareProgress& progress = *reply.mutable_share_progress();
      progress.set_order(request.share_progress().order());
      progress.set_version(request.share_progress().after_version() + 1);
      progress.set_is_over(progress.version() >= static_cast<std::uint64_t>(steps_));
      progress.set_is_complete(progress.is_over());
    }
    return {Frame(message, reply)};
  }

  AgentId leader = 1;
  int orders = 0;
  int errors = 0;
  double last_wait_s = 0;

 private:
  const int steps_;
};

TEST(OrdersTest, WaitsInOneCallWithoutAProgressCallback) {
  SharingAgent sharing(3);
  FakeAgent agent([&](const proto::ClientMessage& message) { return sharing.Answer(message); });
  auto client = ConnectTo(agent);
  const auto progress = client->Sync({.limit = std::chrono::seconds(40)});
  ASSERT_TRUE(progress) << ToString(progress.error());
  EXPECT_TRUE(progress->is_complete());
  EXPECT_EQ(sharing.orders, 1);
  EXPECT_NEAR(sharing.last_wait_s, 40, 5);
}

TEST(OrdersTest, ReportsEachProgress) {
  SharingAgent sharing(3);
  FakeAgent agent([&](const proto::ClientMessage& message) { return sharing.Answer(message); });
  auto client = ConnectTo(agent);
  std::vector<std::uint64_t> versions;
  const auto progress =
      client->Replicate({.on_progress = [&](const proto::ShareProgress& news) { versions.push_back(news.version()); }});
  ASSERT_TRUE(progress) << ToString(progress.error());
  EXPECT_TRUE(progress->is_complete());
  EXPECT_THAT(versions, testing::ElementsAre(1, 2, 3));
}

TEST(OrdersTest, RepeatsAnOrderAfterAChangeOfRoles) {
  SharingAgent sharing(1);
  sharing.errors = 2;
  FakeAgent agent([&](const proto::ClientMessage& message) { return sharing.Answer(message); });
  auto client = ConnectTo(agent);
  const auto progress = client->Sync({});
  ASSERT_TRUE(progress) << ToString(progress.error());
  EXPECT_EQ(sharing.orders, 3);
}

TEST(OrdersTest, DoesNotRepeatAnOrderIndefinitely) {
  SharingAgent sharing(1);
  sharing.errors = 100;
  FakeAgent agent([&](const proto::ClientMessage& message) { return sharing.Answer(message); });
  auto client = ConnectTo(agent);
  const auto progress = client->Sync({});
  ASSERT_FALSE(progress);
  EXPECT_EQ(progress.error().field, "expected_term");
  EXPECT_EQ(sharing.orders, 6);
}

// A deposed leader would share only its own records, not the team's.
TEST(OrdersTest, ADeposedLeaderIsNotAskedAgain) {
  SharingAgent sharing(1);
  FakeAgent agent([&](const proto::ClientMessage& message) {
    const auto answer = sharing.Answer(message);
    if (message.control_request().has_share()) sharing.leader = 2;
    return answer;
  });
  sharing.errors = 1;
  auto client = ConnectTo(agent);
  const auto progress = client->Sync({});
  ASSERT_FALSE(progress);
  EXPECT_THAT(progress.error().text, HasSubstr("is no longer the leader"));
  EXPECT_EQ(sharing.orders, 1);
}

TEST(OrdersTest, AChangeOfRolesWithALostReplyHappensOnce) {
  proto::RoleAssignment roles;
  roles.set_leader(1);
  roles.set_survivor(2);
  roles.mutable_term()->set_number(1);
  int sets = 0;
  FakeAgent agent([&](const proto::ClientMessage& message) -> std::vector<std::string> {
    const proto::ControlRequest& request = message.control_request();
    proto::ControlReply reply;
    if (request.has_role_set()) {
      if (++sets == 1) {  // The agent changes the roles, but its reply is lost.
        roles.set_leader(2);
        roles.set_survivor(1);
        roles.mutable_term()->set_number(2);
        roles.mutable_term()->set_issuer(2);
        return {};
      }
      return {Frame(message, ErrorReply(proto::ERROR_CODE_REFUSED, "another stands", "expected"))};
    }
    *reply.mutable_roles()->mutable_roles() = roles;
    reply.mutable_roles()->add_confirmed_by(1);
    reply.mutable_roles()->add_confirmed_by(2);
    return {Frame(message, reply)};
  });
  Client::Options options;
  options.timeout = milliseconds(100);
  auto client = ConnectTo(agent, options);
  proto::RoleSetRequest swap;
  swap.set_is_swap(true);
  const auto standing = client->Roles();
  ASSERT_TRUE(standing);
  const auto shown =
      ChangeRolesUntilDone(*client, swap, standing->roles(), std::chrono::seconds(5), /*is_waiting=*/false);
  ASSERT_TRUE(shown) << ToString(shown.error());
  EXPECT_EQ(shown->roles().leader(), 2u);
  EXPECT_EQ(roles.leader(), 2u) << "it was not undone";
}

// Answers with rows 1 to 5, two per page. For later rows, answers with an empty page.
std::vector<std::string> AnswerRead(const proto::ClientMessage& request) {
  const proto::ReadRequest& read = request.control_request().read();
  proto::ControlReply reply;
  proto::ReadReply& page = *reply.mutable_read();
  const std::uint64_t first = read.is_newest_first() ? 5 : read.after_row_id() + 1;
  for (std::uint64_t row = first; row <= 5 && page.row_ids_size() < 2; ++row) {
    page.add_row_ids(row);
    page.add_records()->mutable_key()->set_seq(row);
  }
  return {Frame(request, reply)};
}

TEST(RecordFeedTest, ReturnsEachRecordOnceInPages) {
  proto::ReadRequest last;
  FakeAgent agent([&last](const proto::ClientMessage& request) {
    last = request.control_request().read();
    return AnswerRead(request);
  });
  auto client = ConnectTo(agent);
  proto::ReadRequest filter;
  filter.add_data_types(proto::POWER);
  filter.set_records_max(2);
  filter.set_is_newest_first(true);  // RecordFeed must ignore this option.
  RecordFeed feed(*client, filter);
  std::vector<std::uint64_t> rows;
  while (true) {
    const auto page = feed.Next(std::chrono::milliseconds(0));
    ASSERT_TRUE(page.has_value()) << ToString(page.error());
    if (page->records().empty()) break;
    EXPECT_LE(page->records_size(), 2);
    rows.insert(rows.end(), page->row_ids().begin(), page->row_ids().end());
  }
  EXPECT_EQ(rows, (std::vector<std::uint64_t>{1, 2, 3, 4, 5}));
  EXPECT_EQ(feed.after_row_id(), 5u);
  agent.Stop();
  EXPECT_EQ(last.data_types(0), proto::POWER);
  EXPECT_EQ(last.records_max(), 2u);
}

TEST(RecordFeedTest, SkipsToNowAndContinuesAtAGivenRow) {
  FakeAgent agent(AnswerRead);
  auto client = ConnectTo(agent);
  RecordFeed from_now(*client, {});
  ASSERT_TRUE(from_now.SkipToNow().has_value());
  EXPECT_EQ(from_now.after_row_id(), 5u);
  EXPECT_TRUE(from_now.Next(std::chrono::milliseconds(0))->records().empty());
  proto::ReadRequest filter;
  filter.set_after_row_id(4);
  RecordFeed again(*client, filter);
  EXPECT_EQ(again.Next(std::chrono::seconds(5))->row_ids(0), 5u);
}

TEST(RecordFeedTest, RequestsNoLongerWaitThanItsTimeout) {
  double wait_s = -1;
  FakeAgent agent([&wait_s](const proto::ClientMessage& request) {
    wait_s = request.control_request().read().wait_s();
    return AnswerRead(request);
  });
  auto client = ConnectTo(agent);
  RecordFeed feed(*client, {});
  ASSERT_TRUE(feed.Next(std::chrono::seconds(3)).has_value());
  EXPECT_GT(wait_s, 1);
  EXPECT_LE(wait_s, 3);
  ASSERT_TRUE(feed.Next(std::chrono::hours(3)).has_value());
  EXPECT_LE(wait_s, 60);
}

TEST(RecordFeedTest, ContinuesAfterALateAnswer) {
  std::atomic<bool> is_silent = true;
  FakeAgent agent([&is_silent](const proto::ClientMessage& request) {
    return is_silent ? std::vector<std::string>() : AnswerRead(request);
  });
  Client::Options options;
  options.timeout = std::chrono::milliseconds(50);
  auto client = ConnectTo(agent, options);
  proto::ReadRequest filter;
  filter.set_after_row_id(4);
  RecordFeed feed(*client, filter);
  EXPECT_EQ(feed.Next(std::chrono::milliseconds(10)).error().code, ErrorCode::kTimedOut);
  is_silent = false;
  const auto page = feed.Next(std::chrono::seconds(60));
  ASSERT_TRUE(page.has_value()) << ToString(page.error());
  EXPECT_EQ(page->row_ids(0), 5u);
}

TEST(RecordFeedTest, ReportsAnInvalidAnswer) {
  FakeAgent agent([](const proto::ClientMessage& request) {
    proto::ControlReply reply;
    reply.mutable_read()->add_records();
    return std::vector{Frame(request, reply)};
  });
  auto client = ConnectTo(agent);
  RecordFeed feed(*client, {});
  EXPECT_EQ(feed.Next(std::chrono::seconds(1)).error().code, ErrorCode::kCorrupt);
}

TEST(ClientTest, RefusesInvalidKeys) {
  FakeAgent agent([](const proto::ClientMessage&) { return std::vector<std::string>(); });
  Client::Options options;
  options.secret_key = "short";
  const auto client = Client::Connect(agent.endpoint(), "rover1", options);
  ASSERT_FALSE(client.has_value());
  EXPECT_EQ(client.error().code, ErrorCode::kInvalid);
}

TEST(ClientTest, InsertsCustomRecordsByTheNameOfTheirType) {
  proto::Record received;
  FakeAgent agent([&received](const proto::ClientMessage& request) {
    received = request.control_request().insert().records(0);
    proto::ControlReply reply;
    reply.mutable_insert()->add_keys()->set_data_type(1000);
    return std::vector{Frame(request, reply)};
  });
  Client::Options options;
  options.custom_types.Add()->set_id(1000);
  options.custom_types.Mutable(0)->set_name("soil");
  auto client = ConnectTo(agent, options);
  Client::Custom custom;
  custom.type = "soil";
  custom.timestamp_ns = 7;
  custom.payload = std::string("\0\xFF", 2);
  custom.latest_key = "hole 3";
  custom.metadata = "percent";
  const auto key = client->InsertCustom(custom);
  ASSERT_TRUE(key.has_value()) << ToString(key.error());
  EXPECT_EQ(key->stream.type, 1000u);
  agent.Stop();
  EXPECT_EQ(received.timestamp_ns(), 7);
  EXPECT_EQ(received.custom().data_type(), 1000u);
  EXPECT_EQ(received.custom().payload(), custom.payload);
  EXPECT_EQ(received.custom().latest_key(), "hole 3");
  EXPECT_EQ(received.custom().metadata(), "percent");

  // The client looks up the type's name before it sends the record.
  EXPECT_EQ(client->TypeNamed("soil"), DataType{1000});
  custom.type = "sol";
  EXPECT_EQ(client->InsertCustom(custom).error().text, "no data type \"sol\"");
  custom.type = "power";
  EXPECT_EQ(client->InsertCustom(custom).error().text, "power is not a custom type");
}

TEST(ClientTest, InsertsLoopClosuresAndPriorsWithSigmasOrCovariances) {
  proto::Record received;
  FakeAgent agent([&received](const proto::ClientMessage& request) {
    received = request.control_request().insert().records(0);
    proto::ControlReply reply;
    reply.mutable_insert()->add_keys();
    return std::vector{Frame(request, reply)};
  });
  auto client = ConnectTo(agent, {});
  Client::LoopClosure closure;
  closure.from = {2, 140};
  closure.to = {1, 17};
  closure.timestamp_ns = 7;
  closure.from_from_to.mutable_position_m()->set_x(1.2);
  closure.covariance = {0.5, 0.5, 2, 0.1, 0.1, 0.3};
  EXPECT_EQ(client->InsertLoopClosure(closure).error().field, "source");
  closure.source = "apriltag";
  ASSERT_TRUE(client->InsertLoopClosure(closure));
  const proto::PoseGraphEdge& edge = received.pose_graph_edge();
  EXPECT_EQ(edge.source(), "apriltag");
  EXPECT_EQ(edge.to().index(), 17u);
  ASSERT_EQ(edge.relative_pose().covariance_size(), 21);
  EXPECT_EQ(edge.relative_pose().covariance(0), 0.25);
  EXPECT_EQ(edge.relative_pose().covariance(11), 4) << "z";
  EXPECT_EQ(edge.relative_pose().covariance(1), 0);
  EXPECT_NEAR(edge.relative_pose().covariance(20), 0.09, 1e-12);

  proto::PosePrior prior;
  prior.mutable_node()->set_agent_id(2);
  prior.mutable_position_m()->set_x(5);
  for (const double sigma_m : {0.5, 0.5, 1.0}) prior.add_covariance(sigma_m);
  prior.set_source("gnss");
  ASSERT_TRUE(client->InsertPrior(prior, 9));
  EXPECT_EQ(received.timestamp_ns(), 9);
  EXPECT_THAT(received.pose_prior().covariance(), testing::ElementsAre(0.25, 0, 0, 0.25, 0, 1));
  prior.mutable_covariance()->CopyFrom(received.pose_prior().covariance());
  ASSERT_TRUE(client->InsertPrior(prior, 9));
  EXPECT_THAT(received.pose_prior().covariance(), testing::ElementsAre(0.25, 0, 0, 0.25, 0, 1)) << "a covariance";
  agent.Stop();
}

TEST(ClientTest, TimesOutAndDropsALateAnswer) {
  std::string late;
  FakeAgent agent([&late](const proto::ClientMessage& request) {
    proto::ControlReply reply;
    reply.mutable_status()->set_name("answer " + std::to_string(request.request_id()));
    if (late.empty()) {
      late = Frame(request, reply);
      return std::vector<std::string>{};
    }
    return std::vector{late, Frame(request, reply)};
  });
  auto client = ConnectTo(agent, {.timeout = milliseconds(50)});
  const auto first = client->Status();
  ASSERT_FALSE(first.has_value());
  EXPECT_EQ(first.error().code, ErrorCode::kTimedOut);
  proto::ControlRequest request;
  request.mutable_status();
  const auto second = client->Call(request, std::chrono::seconds(10));
  ASSERT_TRUE(second.has_value()) << ToString(second.error());
  EXPECT_EQ(second->status().name(), "answer 2");
}

TEST(ClientTest, NoticesThatTheAgentWentAwayDuringACall) {
  FakeAgent* running = nullptr;
  std::thread stopper;
  FakeAgent agent([&](const proto::ClientMessage&) {
    stopper = std::thread([&] { running->Stop(); });
    return std::vector<std::string>{};
  });
  running = &agent;
  auto client = ConnectTo(agent, {.timeout = std::chrono::seconds(30)});
  const auto start = std::chrono::steady_clock::now();
  const auto status = client->Status();
  stopper.join();
  ASSERT_FALSE(status.has_value());
  EXPECT_EQ(status.error().code, ErrorCode::kUnavailable);
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(10));
}

TEST(ClientTest, WaitsOnWhenASignalInterruptsACall) {
  std::signal(SIGUSR1, [](int) {});
  const pthread_t caller = ::pthread_self();
  FakeAgent agent([caller](const proto::ClientMessage& request) {
    for (int i = 0; i < 5; ++i) {
      std::this_thread::sleep_for(milliseconds(10));
      ::pthread_kill(caller, SIGUSR1);
    }
    proto::ControlReply reply;
    reply.mutable_status()->set_name("rover1");
    return std::vector{Frame(request, reply)};
  });
  auto client = ConnectTo(agent);
  const auto status = client->Status();
  ASSERT_TRUE(status.has_value()) << ToString(status.error());
}

TEST(ClientTest, RefusesARequestThatIsTooLarge) {
  FakeAgent agent([](const proto::ClientMessage&) { return std::vector<std::string>{}; });
  auto client = ConnectTo(agent, {.message_bytes_max = 1000});
  proto::Record record;
  record.mutable_health()->set_text(std::string(2000, 'x'));
  const auto keys = client->Insert({record});
  ASSERT_FALSE(keys.has_value());
  EXPECT_EQ(keys.error().code, ErrorCode::kInvalid);
  EXPECT_EQ(agent.requests(), 0);
}

TEST(ClientTest, ReportsAnAnswerThatDoesNotDecode) {
  FakeAgent agent([](const proto::ClientMessage&) { return std::vector<std::string>{"\xff\xff\xff"}; });
  auto client = ConnectTo(agent);
  const auto status = client->Status();
  ASSERT_FALSE(status.has_value());
  EXPECT_EQ(status.error().code, ErrorCode::kCorrupt);
}

// A server that sends a message without end. It implements ZMTP 3 itself, because libzmq sends a message only when it
// has the message's last frame.
class EndlessMessageServer {
 public:
  EndlessMessageServer() {
    listener_ = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof(address);
    const bool listens = bind(listener_, reinterpret_cast<const sockaddr*>(&address), size) == 0 &&
                         listen(listener_, 1) == 0 &&
                         getsockname(listener_, reinterpret_cast<sockaddr*>(&address), &size) == 0;
    EXPECT_TRUE(listens) << std::strerror(errno);
    endpoint_ = "tcp://127.0.0.1:" + std::to_string(ntohs(address.sin_port));
    thread_ = std::thread([this] { Run(); });
  }
  ~EndlessMessageServer() {
    thread_.join();
    close(listener_);
  }

  const std::string& endpoint() const { return endpoint_; }
  std::uint64_t sent_bytes() const { return sent_bytes_; }

 private:
  // Sends frames until the client disconnects.
  void Run() {
    const int client = accept(listener_, nullptr, nullptr);
    std::string greeting("\xff\0\0\0\0\0\0\0\0\x7f\x03\0NULL", 16);
    greeting.resize(64, '\0');
    const std::string ready("\x04\x1c\x05READY\x0bSocket-Type\0\0\0\x06ROUTER", 30);
    // A long frame (flag 2) after which more frames follow (flag 1).
    const std::string frame = std::string("\x03\0\0\0\0\0\x01\0\0", 9) + std::string(65'536, 'x');
    bool stands = Send(client, greeting) && Send(client, ready);
    // Wait for the client's greeting and READY. The client accepts messages only after these.
    std::array<char, 256> block{};
    for (std::size_t received = 0; stands && received <= greeting.size();) {
      const ssize_t size = recv(client, block.data(), block.size(), 0);
      stands = size > 0;
      received += stands ? static_cast<std::size_t>(size) : 0;
    }
    while (stands && sent_bytes_ < 512 << 20) {
      stands = Send(client, frame);
      sent_bytes_ += frame.size();
    }
    close(client);
  }
  static bool Send(int client, const std::string& bytes) {
    return send(client, bytes.data(), bytes.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(bytes.size());
  }

  int listener_ = -1;
  std::string endpoint_;
  std::atomic<std::uint64_t> sent_bytes_ = 0;
  std::thread thread_;
};

TEST(ClientTest, DisconnectsFromAnAgentThatSendsAnEndlessMessage) {
  EndlessMessageServer server;
  Client::Options options;
  options.message_bytes_max = 1024 * 1024;
  const Result<std::unique_ptr<Client>> client = Client::Connect(server.endpoint(), "rover1", options);
  ASSERT_TRUE(client) << ToString(client.error());
  const auto status = (*client)->Status();
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kCorrupt) << ToString(status.error());
}

TEST(ClientTest, ReadsAllPagesInOrder) {
  // The agent has five records and returns two per page.
  FakeAgent agent([](const proto::ClientMessage& request) {
    proto::ControlReply reply;
    proto::ReadReply& page = *reply.mutable_read();
    for (std::uint64_t row = request.control_request().read().after_row_id() + 1; row <= 5; ++row) {
      if (page.records_size() == 2) return std::vector{Frame(request, reply)};
      proto::Record record;
      record.set_timestamp_ns(static_cast<std::int64_t>(row));
      page.add_records()->set_content(record.SerializeAsString());
      page.add_row_ids(row);
    }
    page.set_is_complete(true);
    return std::vector{Frame(request, reply)};
  });
  auto client = ConnectTo(agent);
  std::vector<std::int64_t> timestamps;
  const auto read = client->ReadAll({}, [&](const proto::StoredRecord&, const proto::Record& record) -> Result<void> {
    timestamps.push_back(record.timestamp_ns());
    return {};
  });
  ASSERT_TRUE(read.has_value()) << ToString(read.error());
  EXPECT_THAT(timestamps, testing::ElementsAre(1, 2, 3, 4, 5));
  EXPECT_EQ(agent.requests(), 3);
}

}  // namespace
}  // namespace moondb
