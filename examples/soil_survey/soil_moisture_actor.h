// SoilMoistureActor ("soil"): measures the soil's moisture periodically, and computes the average of each agent's
// measurements.
//
// Every `period` the actor reads the sensor and inserts a record of the custom type `soil_moisture`. It reads all
// stored measurements, including those that other agents have shared, and answers AverageRequest from actors and
// clients.
//
// After a restart the actor reads all measurements again. If an insert fails, it logs the error and the measurement is
// lost.
#pragma once

#include <chrono>
#include <functional>
#include <map>

#include "model/error.h"
#include "model/ids.h"
#include "proto/storage.pb.h"
#include "runtime/actor.h"
#include "runtime/record_reader.h"
#include "soil_survey.pb.h"

namespace soil_survey {

inline constexpr char kActorName[] = "soil";
inline constexpr char kDataTypeName[] = "soil_moisture";

// Returns the fraction of water, 0 to 1. Called inside a handler, so it must not block.
using Sensor = std::function<moondb::Result<double>()>;

class SoilMoistureActor final : public moondb::Actor {
 public:
  struct Options {
    moondb::DataType data_type = 0;  // The id of `soil_moisture` in the team file.
    Sensor sensor;                   // Empty if this agent does not measure.
    moondb::Duration period = std::chrono::minutes(10);
  };

  explicit SoilMoistureActor(Options options);

  void OnStart(moondb::Context& context) override;
  void OnMessage(moondb::Context& context, const moondb::proto::Message& message) override;

 private:
  struct Sum {
    double water_ratio = 0;
    std::uint64_t measurements = 0;
  };

  void OnCustom(moondb::Context& context, const google::protobuf::Any& question);
  void Measure(moondb::Context& context);
  moondb::Result<void> Add(const moondb::proto::StoredRecord& stored);

  const Options options_;
  std::map<moondb::AgentId, Sum> sums_;
  moondb::RecordReader reader_;  // Reads stored measurements into sums_.
};

}  // namespace soil_survey
