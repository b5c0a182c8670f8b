#include "apps/moondb_sim/rare_states.h"

#include <gtest/gtest.h>

namespace moondb::simulation {
namespace {

const Address kSync{1, actor_name::kSync};

proto::Message Roles(std::uint64_t term) {
  proto::Message message;
  message.mutable_roles_changed()->mutable_roles()->mutable_term()->set_number(term);
  return message;
}

proto::Message Batch(std::uint64_t session_id, std::uint64_t remaining) {
  proto::Message message;
  message.set_source_actor(actor_name::kSync);
  message.set_remaining(remaining);
  message.mutable_batch()->set_session_id(session_id);
  return message;
}

proto::Message Fragment(std::uint64_t session_id, std::uint64_t first_byte) {
  proto::Message message = Batch(session_id, 1);
  message.mutable_batch()->mutable_fragment()->set_hash(9);
  message.mutable_batch()->mutable_fragment()->set_first_byte(first_byte);
  return message;
}

int CountOf(const RareStates& states, const std::string& name) {
  const auto count = states.counts().find(name);
  return count == states.counts().end() ? 0 : count->second;
}

TEST(RareStatesTest, ALargeRecordGoesOnInAnotherSession) {
  RareStates states;
  states.OnHandle(kSync, Roles(1));
  states.OnRadio(1, 2, Fragment(7, 0));
  states.OnRadio(1, 2, Fragment(7, 4096));
  EXPECT_EQ(CountOf(states, "fragment_resumed"), 0);
  states.OnRadio(1, 2, Fragment(8, 8192));
  EXPECT_EQ(CountOf(states, "fragment_resumed"), 1);
  EXPECT_EQ(CountOf(states, "fragment_after_roles"), 0);
  states.OnHandle(kSync, Roles(2));
  states.OnRadio(1, 2, Fragment(9, 8192));
  EXPECT_EQ(CountOf(states, "fragment_after_roles"), 1);
}

TEST(RareStatesTest, RolesChangeAtTheEndOfASession) {
  RareStates states;
  states.OnHandle(kSync, Roles(1));
  states.OnRadio(1, 2, Batch(7, 3));
  states.OnHandle(kSync, Roles(2));
  EXPECT_EQ(CountOf(states, "roles_at_the_end"), 0);
  states.OnRadio(1, 2, Batch(7, 0));
  states.OnHandle(kSync, Roles(3));
  EXPECT_EQ(CountOf(states, "roles_at_the_end"), 1);
  proto::Message have;
  have.set_hop_sender(2);
  have.mutable_have();
  states.OnHandle(kSync, have);
  states.OnHandle(kSync, Roles(4));
  EXPECT_EQ(CountOf(states, "roles_at_the_end"), 1);
}

TEST(RareStatesTest, RolesChangeWhileAMapIsWaitedFor) {
  RareStates states;
  proto::Message question;
  question.mutable_merge_request();
  proto::Message answer;
  answer.mutable_merge_reply();
  states.OnHandle(kSync, Roles(1));
  states.OnHandle({1, actor_name::kMerge}, question);
  states.OnHandle(kSync, Roles(2));
  EXPECT_EQ(CountOf(states, "roles_amid_merge"), 1);
  states.OnHandle({1, actor_name::kGateway}, answer);
  states.OnHandle(kSync, Roles(3));
  EXPECT_EQ(CountOf(states, "roles_amid_merge"), 1);
}

}  // namespace
}  // namespace moondb::simulation
