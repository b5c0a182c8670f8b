#include "actors/gateway/client_rights.h"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace moondb {
namespace {

// By hand, so that a new request is placed on purpose: one that stands in none of these needs the right `command`.
const std::set<std::string> kView = {"status",  "read",      "role_show", "share_status", "graph_stats",
                                     "trace",   "have",      "verify",    "fingerprint",  "merge",
                                     "map_why", "map_stats", "map_tiles", "read_bundle"};
const std::set<std::string> kShare = {"insert", "share", "lease", "optimize", "custom"};
const std::set<std::string> kCommand = {"role_set", "stop", "prune", "downlink", "acknowledge"};

TEST(ClientRightsTest, EveryRequestHasItsPlace) {
  const auto* requests = proto::ControlRequest::descriptor()->FindOneofByName("request");
  ASSERT_NE(requests, nullptr);
  for (int i = 0; i < requests->field_count(); ++i) {
    const auto* field = requests->field(i);
    const auto needed = RightsNeededFor(static_cast<proto::ControlRequest::RequestCase>(field->number()));
    if (kView.contains(field->name())) {
      EXPECT_EQ(needed, proto::CLIENT_RIGHTS_VIEW) << field->name();
    }
    if (kShare.contains(field->name())) {
      EXPECT_EQ(needed, proto::CLIENT_RIGHTS_SHARE) << field->name();
    }
    if (!kView.contains(field->name()) && !kShare.contains(field->name())) {
      EXPECT_EQ(needed, proto::CLIENT_RIGHTS_COMMAND) << field->name() << " is not listed here";
    }
  }
  for (const std::set<std::string>& listed : {kView, kShare, kCommand}) {
    for (const std::string& name : listed) {
      EXPECT_NE(proto::ControlRequest::descriptor()->FindFieldByName(name), nullptr) << name;
    }
  }
}

TEST(ClientRightsTest, SaysWhichRightIsNeededAndWhichThereIs) {
  proto::Message message;
  message.set_client_name("anna");
  message.set_client_rights(proto::CLIENT_RIGHTS_VIEW);
  const auto checked = CheckClientRights(message, proto::ControlRequest::kInsert);
  ASSERT_FALSE(checked.has_value());
  EXPECT_EQ(checked.error().code, ErrorCode::kRefused);
  EXPECT_EQ(checked.error().text, "this needs the right to share; the key of anna has the right to view");
  message.set_client_rights(proto::CLIENT_RIGHTS_NONE);
  EXPECT_EQ(CheckClientRights(message, proto::ControlRequest::kInsert).error().text,
            "your key is no longer listed at this agent");
  message.set_client_rights(proto::CLIENT_RIGHTS_SHARE);
  EXPECT_TRUE(CheckClientRights(message, proto::ControlRequest::kInsert).has_value());
  message.set_client_rights(proto::CLIENT_RIGHTS_COMMAND);
  EXPECT_TRUE(CheckClientRights(message, proto::ControlRequest::kInsert).has_value());
}

}  // namespace
}  // namespace moondb
