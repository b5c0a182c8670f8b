// Checks that each type of the enumeration DataType has a table row, a body in proto::Record, and everything else that
// a built-in type needs.
#include "model/data_types.h"

#include <gmock/gmock.h>

#include "model/custom_types.h"
#include "model/record_check.h"
#include "model/text.h"
#include "proto/types.pb.h"
#include "tests/sample_record.h"

namespace moondb {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using testing::UnorderedElementsAreArray;

std::vector<std::string> EnumeratedTypes() {
  std::vector<std::string> names;
  const auto& types = *proto::DataType_descriptor();
  for (int i = 0; i < types.value_count(); ++i) {
    if (types.value(i)->number() != 0) names.push_back(DataTypeName(static_cast<DataType>(types.value(i)->number())));
  }
  return names;
}

std::string PolicyName(proto::Policy policy) {
  return policy == proto::POLICY_ALL ? "all" : policy == proto::POLICY_LATEST ? "latest" : "none";
}

std::string SpeakerName(Speaker speaker) {
  switch (speaker) {
    case Speaker::kAnyAgent:
      return "any agent";
    case Speaker::kNamedAgent:
      return "an agent named";
    case Speaker::kNamedAgentOrCommander:
      return "an agent named, a commander";
    case Speaker::kLeader:
      return "the leader";
    case Speaker::kNamedAgentOrLeader:
      return "an agent named, a commander, the leader";
  }
  return "";
}

std::string RecipientName(LeaderSends sends) {
  return sends == LeaderSends::kToAllRovers    ? "all rovers"
         : sends == LeaderSends::kToAgentNamed ? "the rover named"
                                               : "-";
}

std::string WorkStartedBy(const DataTypeRow& row) {
  if (row.is_news_for_solve) return row.is_news_for_matching ? "solve, matching" : "solve";
  return row.is_news_for_matching ? "matching" : "-";
}

// Returns the paths of all set fields in `message` that name an agent, such as "node.agent_id".
std::vector<std::string> AgentFieldsIn(const Message& message, const std::string& path) {
  std::vector<std::string> fields;
  std::vector<const FieldDescriptor*> set;
  message.GetReflection()->ListFields(message, &set);
  for (const FieldDescriptor* field : set) {
    const std::string at = path + "." + field->name();
    const bool is_role = field->name() == "issuer" || field->name() == "leader" || field->name() == "survivor";
    const bool is_solves =
        path.find("role_assignment") == std::string::npos;  // Issuers of terms in other records need no check.
    if (field->name() == "agent_id" || (is_role && !is_solves)) fields.push_back(at);
    if (field->is_repeated() || field->cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE) continue;
    const auto inner = AgentFieldsIn(message.GetReflection()->GetMessage(message, field), at);
    fields.insert(fields.end(), inner.begin(), inner.end());
  }
  return fields;
}

TEST(DataTypesTest, HaveARowForEachEnumerator) {
  std::vector<std::string> rows;
  for (const DataTypeRow& row : DataTypeRows()) rows.push_back(DataTypeName(row.type));
  EXPECT_THAT(rows, UnorderedElementsAreArray(EnumeratedTypes()))
      << "model/data_types.cc and the enumeration DataType in proto/types.proto differ";
}

// Without its term, a record of a leader would never count in a team with keys.
TEST(DataTypesTest, StateTheirTermIfALeaderWritesThem) {
  for (const DataTypeRow& row : DataTypeRows()) {
    const proto::Record record = SampleRecord(row.type, 1);
    const FieldDescriptor* body =
        record.GetReflection()->GetOneofFieldDescriptor(record, record.GetDescriptor()->FindOneofByName("body"));
    const Message& content = record.GetReflection()->GetMessage(record, body);
    const FieldDescriptor* term = content.GetDescriptor()->FindFieldByName("term");
    const bool is_of_leader = row.speaker == Speaker::kLeader || row.speaker == Speaker::kNamedAgentOrLeader;
    EXPECT_EQ(row.term != nullptr, is_of_leader) << DataTypeName(row.type) << ": DataTypeRow::term and speaker";
    // The term of a role assignment is its own.
    if (row.type == proto::ROLE_ASSIGNMENT) continue;
    EXPECT_EQ(term != nullptr, is_of_leader) << DataTypeName(row.type) << ": a field `term` and speaker";
    if (term == nullptr || row.term == nullptr) continue;
    EXPECT_EQ(&row.term(record), &content.GetReflection()->GetMessage(content, term)) << DataTypeName(row.type);
  }
}

TEST(DataTypesTest, HaveABodyOfTheirNameInARecord) {
  std::vector<std::string> bodies;
  const auto& oneof = *proto::Record::descriptor()->FindOneofByName("body");
  for (int i = 0; i < oneof.field_count(); ++i) {
    if (oneof.field(i)->name() != "custom") bodies.push_back(oneof.field(i)->name());
  }
  EXPECT_THAT(bodies, UnorderedElementsAreArray(EnumeratedTypes()))
      << "the oneof `body` in proto/record.proto and the enumeration DataType in proto/types.proto differ";
}

TEST(DataTypesTest, AreRecognizedAndPassTheirOwnCheck) {
  for (const DataTypeRow& row : DataTypeRows()) {
    SCOPED_TRACE(DataTypeName(row.type));
    const proto::Record record = SampleRecord(row.type, 1);
    EXPECT_EQ(TypeOf(record), row.type);
    const Result<void> checked = CheckRecord(record);
    EXPECT_TRUE(checked) << ToString(checked.error()) << " (a sample of its own belongs into tests/sample_record.h)";
  }
}

TEST(DataTypesTest, NameEveryAgentOfTheirFields) {
  for (const DataTypeRow& row : DataTypeRows()) {
    const std::string name = DataTypeName(row.type);
    const proto::Record record = SampleRecord(row.type, 1);
    const auto* body = proto::Record::descriptor()->FindFieldByName(name);
    ASSERT_NE(body, nullptr) << name;
    std::vector<std::string> named;
    for (const NamedAgent& agent : AgentsNamedIn(record)) {
      named.push_back(agent.field);
      EXPECT_GT(agent.agent, 0u) << agent.field;
    }
    EXPECT_THAT(named, UnorderedElementsAreArray(AgentFieldsIn(record.GetReflection()->GetMessage(record, body), name)))
        << "DataTypeRow::agents of " << name << " in model/data_types.cc";
  }
}

TEST(DataTypesTest, AreSharedByAPolicyThatTheyMayHave) {
  for (const DataTypeRow& row : DataTypeRows()) {
    for (const proto::Policy policy : {row.share, row.ground}) {
      EXPECT_NE(policy, proto::POLICY_UNSPECIFIED) << DataTypeName(row.type);
      EXPECT_TRUE(policy != proto::POLICY_LATEST || row.may_be_latest) << DataTypeName(row.type);
    }
  }
}

// Fails for a row whose properties nobody decided, because the page states them too.
TEST(DataTypesTest, HaveALineWithTheirPropertiesInTheirGuide) {
  const Result<std::string> guide = ReadTextFile(std::string(MOONDB_SOURCE_DIR) + "/docs/DATA_TYPES.md");
  ASSERT_TRUE(guide);
  for (const DataTypeRow& row : DataTypeRows()) {
    std::string line = "| `" + DataTypeName(row.type) + "` | ";
    for (const std::string& cell : {PolicyName(row.share), PolicyName(row.ground), SpeakerName(row.speaker),
                                    RecipientName(row.leader_sends), WorkStartedBy(row)}) {
      line += cell + " | ";
    }
    EXPECT_NE(guide->find("\n" + line), std::string::npos)
        << "docs/DATA_TYPES.md must have a line that begins: " << line << "\nor model/data_types.cc is wrong";
  }
}

TEST(DataTypesTest, AreRankedKeptAndSupersededAsDerivedIfOnlyALeaderWritesThem) {
  for (const DataTypeRow& row : DataTypeRows()) {
    if (!IsDerived(row.type)) continue;
    EXPECT_EQ(row.rank, ShareRank::kDerived) << "DataTypeRow::rank of " << DataTypeName(row.type);
    EXPECT_TRUE(row.is_kept_unless_named) << "DataTypeRow::is_kept_unless_named of " << DataTypeName(row.type);
    if (row.share != proto::POLICY_LATEST) continue;
    EXPECT_NE(row.latest_key, nullptr) << "DataTypeRow::latest_key of " << DataTypeName(row.type);
    EXPECT_NE(row.version, nullptr) << "DataTypeRow::version of " << DataTypeName(row.type);
  }
}

TEST(DataTypesTest, AreUnknownWithoutARow) {
  EXPECT_EQ(FindDataType(proto::DATA_TYPE_UNSPECIFIED), nullptr);
  EXPECT_EQ(FindDataType(kCustomDataTypeMin), nullptr);
  EXPECT_EQ(FindDataType(proto::DataType_MAX + 1), nullptr);
  EXPECT_TRUE(AgentsNamedIn(proto::Record()).empty());
}

}  // namespace
}  // namespace moondb
