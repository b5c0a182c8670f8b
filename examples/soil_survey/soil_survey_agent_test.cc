// Tests SoilMoistureActor in a real agent, with threads, a database file, sockets and a client.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <filesystem>
#include <thread>

#include "apps/moondb_agent/agent.h"
#include "client/client.h"
#include "soil_moisture_actor.h"

namespace soil_survey {
namespace {

constexpr moondb::DataType kSoilMoisture = 1007;

class SoilSurveyAgentTest : public testing::Test {
 protected:
  SoilSurveyAgentTest() {
    std::string pattern = (std::filesystem::temp_directory_path() / "soil-XXXXXX").string();
    folder_ = ::mkdtemp(pattern.data());
    ::setenv("MOONDB_RUN_DIR", (folder_ / "run").c_str(), 1);
    for (auto& agent : *file_.config.mutable_agents()) agent.set_address("ipc://" + (folder_ / agent.name()).string());
  }
  ~SoilSurveyAgentTest() override { std::filesystem::remove_all(folder_); }

  moondb::AgentOptions OptionsWithTheActor() const {
    SoilMoistureActor::Options soil;
    soil.data_type = kSoilMoisture;
    soil.sensor = [] { return 0.3; };
    soil.period = std::chrono::milliseconds(1);
    moondb::AgentOptions options;
    options.name = "rover1";
    options.data_folder = folder_ / "data";
    options.merge_backend = moondb::MergeBackend::kCpu;
    options.own_actors = {{kActorName, [soil] { return std::make_unique<SoilMoistureActor>(soil); }, {}}};
    return options;
  }

  // Sends AverageRequest as a client until the reply contains an average, for at most 30 s. Returns the last reply.
  static AverageReply RequestUntilThereIsAnAverage(const moondb::Agent& agent) {
    AverageReply reply;
    const auto client = moondb::Client::Connect(agent.client_endpoint(), "rover1", {});
    EXPECT_TRUE(client.has_value()) << ToString(client.error());
    google::protobuf::Any question;
    question.PackFrom(AverageRequest());
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (client && reply.averages().empty() && std::chrono::steady_clock::now() < deadline) {
      const auto answer = (*client)->RequestActor(kActorName, question);
      EXPECT_TRUE(answer.has_value() && answer->UnpackTo(&reply));
    }
    return reply;
  }

  std::filesystem::path folder_;
  moondb::TeamFile file_ = *moondb::ReadTeamFile(TEAM_FILE);
};

TEST_F(SoilSurveyAgentTest, AnswersAClient) {
  auto agent = moondb::Agent::Start(file_, OptionsWithTheActor());
  ASSERT_TRUE(agent.has_value()) << ToString(agent.error());
  const AverageReply reply = RequestUntilThereIsAnAverage(**agent);
  ASSERT_EQ(reply.averages_size(), 1);
  EXPECT_EQ(reply.averages(0).agent_id(), 1u);
  EXPECT_NEAR(reply.averages(0).water_ratio(), 0.3, 1e-9);
}

TEST_F(SoilSurveyAgentTest, TakesMeasurementsFromAThreadOfTheProgram) {
  moondb::AgentOptions options = OptionsWithTheActor();
  options.own_actors[0].factory = [] {
    SoilMoistureActor::Options soil;
    soil.data_type = kSoilMoisture;
    return std::make_unique<SoilMoistureActor>(soil);
  };
  auto agent = moondb::Agent::Start(file_, std::move(options));
  ASSERT_TRUE(agent.has_value()) << ToString(agent.error());
  std::thread driver([&agent] {
    SoilMoisture moisture;
    moisture.set_water_ratio(0.2);
    moondb::proto::Message message;
    moondb::proto::Record& record = *message.mutable_insert_request()->add_records();
    record.mutable_custom()->set_data_type(kSoilMoisture);
    record.mutable_custom()->set_payload(moisture.SerializeAsString());
    EXPECT_EQ((*agent)->Post(moondb::actor_name::kStorage, message), moondb::SendResult::kAccepted);
  });
  const AverageReply reply = RequestUntilThereIsAnAverage(**agent);
  driver.join();
  ASSERT_EQ(reply.averages_size(), 1);
  EXPECT_NEAR(reply.averages(0).water_ratio(), 0.2, 1e-9);
}

TEST_F(SoilSurveyAgentTest, RefusesClientRequestsToStandardActors) {
  auto agent = moondb::Agent::Start(file_, OptionsWithTheActor());
  ASSERT_TRUE(agent.has_value()) << ToString(agent.error());
  const auto client = moondb::Client::Connect((*agent)->client_endpoint(), "rover1", {});
  ASSERT_TRUE(client.has_value()) << ToString(client.error());
  EXPECT_EQ((*client)->RequestActor("storage", {}).error().code, moondb::ErrorCode::kNotFound);
}

TEST_F(SoilSurveyAgentTest, RefusesTheNameOfAStandardActor) {
  moondb::AgentOptions options = OptionsWithTheActor();
  options.own_actors[0].name = moondb::actor_name::kStorage;
  EXPECT_EQ(moondb::Agent::Start(file_, options).error().code, moondb::ErrorCode::kInvalid);
}

}  // namespace
}  // namespace soil_survey
