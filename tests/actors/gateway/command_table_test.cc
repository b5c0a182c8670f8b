#include "actors/gateway/command_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <regex>
#include <set>
#include <sstream>

#include "model/control_message.h"
#include "model/control_request.h"
#include "runtime/address.h"

namespace moondb {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::OneofDescriptor;
using testing::ElementsAre;
using testing::IsEmpty;

const std::set<std::string> kAnswerers = {actor_name::kStorage,   actor_name::kRole,    actor_name::kLease,
                                          actor_name::kEvent,     actor_name::kSync,    actor_name::kReplica,
                                          actor_name::kPgo,       actor_name::kMerge,   actor_name::kDownlink,
                                          actor_name::kRetention, actor_name::kRegister};
// Requests for which proto/control.proto names no actor.
const std::set<std::string> kOfTheGateway = {"stop", "trace", "custom"};

std::string ReadFile(const std::string& path) {
  std::ifstream file(path);
  std::ostringstream text;
  text << file.rdbuf();
  return text.str();
}

const OneofDescriptor& Requests() { return *proto::ControlRequest::descriptor()->FindOneofByName("request"); }

proto::ControlRequest Empty(const FieldDescriptor* field) {
  proto::ControlRequest request;
  request.GetReflection()->MutableMessage(&request, field);
  return request;
}

std::vector<std::string> ActorsOf(const proto::ControlRequest& request) {
  std::vector<std::string> actors;
  for (const Question& question : QuestionsOf(request, /*is_relayed=*/false)) actors.push_back(question.actor);
  return actors;
}

TEST(CommandTableTest, EveryRequestHasItsRow) {
  for (int i = 0; i < Requests().field_count(); ++i) {
    const FieldDescriptor* field = Requests().field(i);
    SCOPED_TRACE(field->name());
    const proto::ControlRequest request = Empty(field);
    const proto::CommandOptions& options = CommandOptionsOf(request.request_case());
    EXPECT_NE(options.rights(), proto::CLIENT_RIGHTS_NONE) << "proto/control.proto does not say which right it needs";
    EXPECT_EQ(options.actors().empty(), kOfTheGateway.contains(field->name()))
        << "proto/control.proto does not say who answers it";
    for (const std::string& actor : options.actors()) EXPECT_TRUE(kAnswerers.contains(actor)) << actor;
    const bool is_of_roles = request.has_role_show() || request.has_role_set();
    const FieldDescriptor* reply =
        proto::ControlReply::descriptor()->FindFieldByName(is_of_roles ? "roles" : field->name());
    EXPECT_TRUE(reply != nullptr && reply->containing_oneof() != nullptr) << "ControlReply has none of its name";
  }
}

// Authors of clients in any language read proto/control.proto. It must describe each request in a comment above it.
TEST(CommandTableTest, EveryRequestIsDocumented) {
  const std::string text = ReadFile(std::string(MOONDB_SOURCE_DIR) + "/proto/control.proto");
  for (int i = 0; i < Requests().field_count(); ++i) {
    const FieldDescriptor* field = Requests().field(i);
    const std::string row =
        "\n    // [A-Z][^\n]{10,}\\.\n    " + field->message_type()->name() + " " + field->name() + " = ";
    EXPECT_TRUE(std::regex_search(text, std::regex(row))) << field->name() << " is not described";
  }
}

TEST(CommandTableTest, RefusesRequestsOfAnotherVersion) {
  EXPECT_EQ(CheckRequest({}, 1, {}).error().field, "request");
  EXPECT_THAT(ActorsOf({}), IsEmpty());
}

TEST(CommandTableTest, AsksTheActorsThatTheRequestNames) {
  for (int i = 0; i < Requests().field_count(); ++i) {
    const proto::ControlRequest request = Empty(Requests().field(i));
    const auto& named = CommandOptionsOf(request.request_case()).actors();
    if (request.has_share() || request.has_share_progress() || request.has_custom()) continue;
    EXPECT_THAT(ActorsOf(request), testing::ElementsAreArray(named)) << Requests().field(i)->name();
  }
  proto::ControlRequest share;
  share.mutable_share()->set_kind(proto::SHARING_KIND_SYNC);
  EXPECT_THAT(ActorsOf(share), ElementsAre("sync"));
  share.mutable_share()->set_kind(proto::SHARING_KIND_REPLICATION);
  EXPECT_THAT(ActorsOf(share), ElementsAre("replica"));
  proto::ControlRequest custom;
  custom.mutable_custom()->set_actor("planner");
  EXPECT_THAT(ActorsOf(custom), ElementsAre("planner"));
}

TEST(CommandTableTest, PutsARequestIntoTheMessageBodyOfItsType) {
  proto::ControlRequest request;
  request.mutable_prune()->set_older_than_s(60);
  const std::vector<Question> questions = QuestionsOf(request, /*is_relayed=*/false);
  ASSERT_EQ(questions.size(), 1u);
  EXPECT_EQ(questions[0].message.prune_order().older_than_s(), 60);
  request.mutable_have()->set_is_for_peer(true);
  EXPECT_FALSE(QuestionsOf(request, false)[0].message.have_request().is_for_peer());
}

// A request may contain maps of several megabytes, which must not be copied.
TEST(CommandTableTest, MovesTheRequestsContentIntoTheQuestion) {
  proto::ControlRequest request;
  std::string& cells = *request.mutable_insert()->add_records()->mutable_custom()->mutable_payload();
  cells.assign(1'000'000, 'x');
  const char* bytes = cells.data();
  const std::vector<Question> questions = QuestionsOf(std::move(request), /*is_relayed=*/false);
  ASSERT_EQ(questions.size(), 1u);
  EXPECT_EQ(questions[0].message.insert_request().records(0).custom().payload().data(), bytes);
}

TEST(CommandTableTest, SendsEachOfSeveralActorsTheWholeRequest) {
  proto::ControlRequest request;
  request.mutable_status();
  for (const Question& question : QuestionsOf(request, /*is_relayed=*/false)) {
    const auto asked = ControlRequestOf(question.message);
    ASSERT_TRUE(asked) << question.actor;
    EXPECT_TRUE(asked->has_status()) << question.actor;
  }
}

TEST(CommandTableTest, AcceptsAnAnswerOfTheMatchingTypeWithItsError) {
  proto::Message answer;
  answer.mutable_prune_reply()->set_text("nothing");
  answer.mutable_prune_reply()->mutable_error()->set_code(proto::ERROR_CODE_FULL);
  proto::ControlReply reply;
  EXPECT_FALSE(TakeAnswer(proto::ControlRequest::kRead, answer, reply)) << "it answers something else";
  EXPECT_EQ(reply.reply_case(), proto::ControlReply::REPLY_NOT_SET);
  EXPECT_TRUE(TakeAnswer(proto::ControlRequest::kPrune, answer, reply));
  EXPECT_EQ(reply.prune().text(), "nothing");
  EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_FULL);
  EXPECT_FALSE(TakeAnswer(proto::ControlRequest::kPrune, {}, reply));
}

TEST(CommandTableTest, AcceptsAnActorsWholeReplyUnchanged) {
  proto::ControlReply answer;
  answer.mutable_error()->set_text("not now");
  proto::ControlReply reply;
  EXPECT_TRUE(TakeAnswer(proto::ControlRequest::kOptimize, MessageOf(answer), reply));
  EXPECT_EQ(reply.error().text(), "not now");
}

TEST(CommandTableTest, RejectsAReplyThatDoesNotDecode) {
  proto::Message answer;
  answer.set_control_reply("\xff\xff");
  proto::ControlReply reply;
  EXPECT_FALSE(TakeAnswer(proto::ControlRequest::kStatus, answer, reply));
  EXPECT_EQ(reply.reply_case(), proto::ControlReply::REPLY_NOT_SET);
}

TEST(CommandTableTest, CopiesTheErrorOfAnActorsReplyToTheTopLevel) {
  proto::ControlReply answer;
  answer.mutable_acknowledge()->mutable_error()->set_code(proto::ERROR_CODE_FULL);
  proto::ControlReply reply;
  EXPECT_TRUE(TakeAnswer(proto::ControlRequest::kAcknowledge, MessageOf(answer), reply));
  EXPECT_EQ(reply.error().code(), proto::ERROR_CODE_FULL);
}

TEST(CommandTableTest, CombinesTheRepliesForStatusAndSharing) {
  proto::ControlReply role;
  role.mutable_status()->mutable_roles()->set_leader(2);
  proto::ControlReply storage;
  storage.mutable_status()->mutable_storage()->set_epoch(7);
  proto::ControlReply reply;
  EXPECT_TRUE(TakeAnswer(proto::ControlRequest::kStatus, MessageOf(role), reply));
  EXPECT_TRUE(TakeAnswer(proto::ControlRequest::kStatus, MessageOf(storage), reply));
  EXPECT_EQ(reply.status().roles().leader(), 2u);
  EXPECT_EQ(reply.status().storage().epoch(), 7u);
  proto::Message shown;
  shown.mutable_role_show_reply()->mutable_roles()->set_leader(2);
  EXPECT_TRUE(TakeAnswer(proto::ControlRequest::kRoleShow, shown, reply));
  EXPECT_EQ(reply.roles().roles().leader(), 2u);
  for (const double received : {3, 4}) {
    proto::ControlReply share;
    share.mutable_share_status()->set_received_records(received);
    share.mutable_share_status()->add_sessions();
    EXPECT_TRUE(TakeAnswer(proto::ControlRequest::kShareStatus, MessageOf(share), reply));
  }
  EXPECT_EQ(reply.share_status().received_records(), 7);
  EXPECT_EQ(reply.share_status().sessions_size(), 2);
}

TEST(CommandTableTest, LogsOnlyRequestsThatChangeSomething) {
  std::set<std::string> written;
  for (int i = 0; i < Requests().field_count(); ++i) {
    if (!CommandText({}, Empty(Requests().field(i))).empty()) written.insert(Requests().field(i)->name());
  }
  EXPECT_THAT(written, testing::UnorderedElementsAre("role_set", "share", "optimize", "stop", "prune", "acknowledge"));
}

}  // namespace
}  // namespace moondb
