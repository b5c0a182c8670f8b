#include "soil_moisture_actor.h"

#include <spdlog/spdlog.h>

#include <utility>

#include "proto/message.pb.h"
#include "proto/record.pb.h"

namespace soil_survey {

using moondb::Context;
using moondb::IsError;
using moondb::SendResult;
using moondb::proto::Message;

namespace {

enum TimerKind : std::uint32_t { kMeasure = 1 };

}  // namespace

SoilMoistureActor::SoilMoistureActor(Options options)
    : options_(std::move(options)),
      reader_({.data_types = {options_.data_type}},
              [this](Context&, const moondb::proto::StoredRecord& stored) { return Add(stored); }) {}

void SoilMoistureActor::OnStart(Context& context) {
  reader_.Follow(context);
  if (options_.sensor) context.AfterTimer(options_.period, kMeasure);
}

void SoilMoistureActor::OnMessage(Context& context, const Message& message) {
  if (reader_.OnMessage(context, message)) return;
  switch (message.body_case()) {
    case Message::kTimer:
      if (message.timer().kind() == kMeasure) Measure(context);
      return;
    case Message::kInsertReply:
      if (IsError(message.insert_reply().error())) {
        spdlog::warn("soil: a measurement was not stored: {}", message.insert_reply().error().text());
      }
      return;
    case Message::kCustom:
      return OnCustom(context, message.custom());
    default:
      return;  // Ignore messages that this version does not know.
  }
}

void SoilMoistureActor::Measure(Context& context) {
  context.AfterTimer(options_.period, kMeasure);
  const moondb::Result<double> water_ratio = options_.sensor();
  if (!water_ratio) return spdlog::warn("soil: {}", ToString(water_ratio.error()));
  SoilMoisture moisture;
  moisture.set_water_ratio(*water_ratio);

  Message message;
  moondb::proto::Record& record = *message.mutable_insert_request()->add_records();
  record.set_timestamp_ns(context.utc_now_ns());
  record.mutable_custom()->set_data_type(options_.data_type);
  record.mutable_custom()->set_payload(moisture.SerializeAsString());
  const moondb::Address storage{context.self().agent, moondb::actor_name::kStorage};
  if (const SendResult sent = context.Send(storage, std::move(message)); sent != SendResult::kAccepted) {
    spdlog::warn("soil: a measurement was not stored: {}", ToString(sent));
  }
}

// Adds the record to the sums. Ignores payloads that are not measurements: other agents may send anything.
moondb::Result<void> SoilMoistureActor::Add(const moondb::proto::StoredRecord& stored) {
  moondb::proto::Record record;
  SoilMoisture moisture;
  if (!record.ParseFromString(stored.content()) || !moisture.ParseFromString(record.custom().payload())) return {};
  if (!(moisture.water_ratio() >= 0 && moisture.water_ratio() <= 1)) return {};
  Sum& sum = sums_[stored.key().origin_agent()];
  sum.water_ratio += moisture.water_ratio();
  ++sum.measurements;
  return {};
}

void SoilMoistureActor::OnCustom(Context& context, const google::protobuf::Any& question) {
  if (!question.Is<AverageRequest>()) return;
  AverageReply reply;
  for (const auto& [agent, sum] : sums_) {
    AgentAverage& average = *reply.add_averages();
    average.set_agent_id(agent);
    average.set_water_ratio(sum.water_ratio / static_cast<double>(sum.measurements));
    average.set_measurements(sum.measurements);
  }
  Message message;
  message.mutable_custom()->PackFrom(reply);
  (void)context.Reply(std::move(message));  // If the reply is lost, the requester asks again.
}

}  // namespace soil_survey
