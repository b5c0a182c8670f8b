// SoilMoistureActor ("soil"): measures the soil's moisture at a fixed pace, stores it, and knows each agent's average.
//
// Every `period` it reads the sensor and hands StorageActor a record of the team's custom type `soil_moisture`. What
// other agents measured comes by moondb's sharing: the actor reads whatever its own storage gets, wherever it is from,
// and answers AverageRequest, from an actor or a client, with the averages over all of it.
//
// Its state is a sum of what is stored, so it is read anew after a restart. A measurement whose insert failed is
// logged and lost; the next one comes soon.
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

// The share of water, 0 to 1. Called inside a handler: it must return at once.
using Sensor = std::function<moondb::Result<double>()>;

class SoilMoistureActor final : public moondb::Actor {
 public:
  struct Options {
    moondb::DataType data_type = 0;  // The id of `soil_moisture` in the team file.
    Sensor sensor;                   // Empty: this agent measures nothing.
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
  moondb::RecordReader reader_;  // Into sums_.
};

}  // namespace soil_survey
