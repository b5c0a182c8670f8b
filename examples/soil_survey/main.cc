// soil_survey_agent: the standard moondb agent with a SoilMoistureActor.
//
//   soil_survey_agent -t team.yaml -a rover1 --soil-sensor /sys/bus/iio/devices/iio:device0/in_soilmoisture_raw
//
// The sensor is a file that contains the fraction of water as a number. Without --soil-sensor the agent stores no
// measurements of its own.

#include "apps/common/arguments.h"
#include "apps/moondb_agent/agent_program.h"
#include "model/custom_types.h"
#include "model/text.h"
#include "soil_moisture_actor.h"

namespace soil_survey {
namespace {

struct Arguments {
  std::string sensor_file;
  double period_s = 600;
};

moondb::Result<double> ReadSensor(const std::string& file) {
  const auto text = moondb::ReadTextFile(file);
  if (!text) return tl::unexpected(text.error());
  std::string_view rest = *text;
  const auto water_ratio = moondb::ParseDouble(moondb::TakeLine(rest));
  if (!water_ratio) return moondb::Fail(moondb::ErrorCode::kCorrupt, "holds no number", file);
  return *water_ratio;
}

moondb::Result<std::vector<moondb::OwnActor>> MakeActors(const Arguments& arguments,
                                                         const moondb::proto::TeamConfig& team) {
  SoilMoistureActor::Options options;
  const auto data_type = moondb::DataTypeFromName(kDataTypeName, team.custom_types());
  if (!data_type) {
    return moondb::Fail(moondb::ErrorCode::kInvalid, "declares no custom type " + std::string(kDataTypeName),
                        "team file");
  }
  options.data_type = *data_type;
  if (!arguments.sensor_file.empty()) options.sensor = [file = arguments.sensor_file] { return ReadSensor(file); };
  options.period = std::chrono::duration_cast<moondb::Duration>(std::chrono::duration<double>(arguments.period_s));

  moondb::OwnActor soil;
  soil.name = kActorName;
  soil.factory = [options] { return std::make_unique<SoilMoistureActor>(options); };
  return std::vector{soil};
}

}  // namespace
}  // namespace soil_survey

int main(int argc, char** argv) {
  soil_survey::Arguments arguments;
  moondb::AgentProgram program;
  program.name = "soil_survey_agent";
  program.version = "1.0";
  program.add_options = [&arguments](moondb::Command& app) {
    app.AddOption("--soil-sensor", arguments.sensor_file, "File that holds the soil's share of water");
    app.AddOption("--soil-period", arguments.period_s, "Seconds between measurements").Within(1., 1e6);
  };
  program.make_actors = [&arguments](moondb::AgentId, const moondb::proto::TeamConfig& team) {
    return soil_survey::MakeActors(arguments, team);
  };
  return moondb::RunAgentProgram(argc, argv, program);
}
