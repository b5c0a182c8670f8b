#include "soil_moisture_actor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

#include "proto/record.pb.h"

namespace soil_survey {

using moondb::Context;
using moondb::IsError;
using moondb::SendResult;
using moondb::proto::Message;

namespace {

enum TimerKind : std::uint32_t { kMeasure = 1, kRead = 2 };

constexpr std::uint32_t kPageRecords = 512;
constexpr std::uint32_t kPageBytes = 1024 * 1024;

moondb::Address Storage(const Context& context) { return {context.self().agent, moondb::actor_name::kStorage}; }

}  // namespace

SoilMoistureActor::SoilMoistureActor(Options options) : options_(std::move(options)) {}

void SoilMoistureActor::OnStart(Context& context) {
  // A random start, so that an answer to a question of an earlier life fits none of this one's.
  read_id_ = context.rng()();
  context.Monitor(Storage(context));
  context.Watch(moondb::Topic::kStored);
  if (options_.sensor) context.AfterTimer(options_.period, kMeasure);
  ReadOn(context);
}

void SoilMoistureActor::OnMessage(Context& context, const Message& message) {
  switch (message.body_case()) {
    case Message::kTimer:
      return OnTimer(context, message.timer());
    case Message::kRecordsStored:
      return OnRecordsStored(context, message.records_stored());
    case Message::kReadReply:
      if (message.request_id() == read_id_) OnReadReply(context, message.read_reply());
      return;
    case Message::kInsertReply:
      if (IsError(message.insert_reply().error())) {
        spdlog::warn("soil: a measurement was not stored: {}", message.insert_reply().error().text());
      }
      return;
    case Message::kDown:
      // Storage failed, perhaps with our question in hand. It has the same address when it is made anew.
      is_reading_ = false;
      return ReadOn(context);
    case Message::kCustom:
      return OnCustom(context, message.custom());
    default:
      return;  // What later versions may say.
  }
}

void SoilMoistureActor::OnTimer(Context& context, const moondb::proto::Timer& timer) {
  switch (timer.kind()) {
    case kMeasure:
      context.AfterTimer(options_.period, kMeasure);
      return Measure(context);
    case kRead:
      return ReadOn(context);
  }
}

void SoilMoistureActor::Measure(Context& context) {
  const moondb::Result<double> water_ratio = options_.sensor();
  if (!water_ratio) return spdlog::warn("soil: {}", ToString(water_ratio.error()));
  SoilMoisture moisture;
  moisture.set_water_ratio(*water_ratio);

  Message message;
  moondb::proto::Record& record = *message.mutable_insert_request()->add_records();
  record.set_stamp_ns(context.utc_now_ns());
  record.mutable_custom()->set_data_type(options_.data_type);
  record.mutable_custom()->set_payload(moisture.SerializeAsString());
  if (const SendResult sent = context.Send(Storage(context), std::move(message)); sent != SendResult::kAccepted) {
    spdlog::warn("soil: a measurement was not stored: {}", ToString(sent));
  }
}

void SoilMoistureActor::ReadOn(Context& context) {
  if (is_reading_) return;  // Storage answers in order: what came before that answer will be in it.
  Message message;
  message.set_request_id(++read_id_);
  moondb::proto::ReadRequest& request = *message.mutable_read_request();
  request.set_after_row_id(last_row_id_);
  request.add_data_types(options_.data_type);
  request.set_records_max(kPageRecords);
  request.set_content_bytes_max(kPageBytes);
  is_reading_ = context.Send(Storage(context), std::move(message)) == SendResult::kAccepted;
  if (!is_reading_) context.AfterTimer(options_.read_again, kRead);
}

void SoilMoistureActor::OnRecordsStored(Context& context, const moondb::proto::RecordsStored& stored) {
  const auto& types = stored.data_types();
  if (std::find(types.begin(), types.end(), options_.data_type) != types.end()) ReadOn(context);
}

void SoilMoistureActor::OnReadReply(Context& context, const moondb::proto::ReadReply& reply) {
  is_reading_ = false;
  if (IsError(reply.error())) return context.Fail(moondb::FromProto(reply.error()));
  for (const moondb::proto::StoredRecord& stored : reply.records()) Add(stored);
  if (!reply.row_ids().empty()) last_row_id_ = *reply.row_ids().rbegin();
  if (!reply.is_complete()) ReadOn(context);
}

// Other agents' records: whatever their payload holds must not harm.
void SoilMoistureActor::Add(const moondb::proto::StoredRecord& stored) {
  moondb::proto::Record record;
  SoilMoisture moisture;
  if (!record.ParseFromString(stored.content()) || !moisture.ParseFromString(record.custom().payload())) return;
  if (!(moisture.water_ratio() >= 0 && moisture.water_ratio() <= 1)) return;
  Sum& sum = sums_[stored.key().origin_agent()];
  sum.water_ratio += moisture.water_ratio();
  ++sum.measurements;
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
  (void)context.Reply(std::move(message));  // Who has gone needs no answer; who misses it asks again.
}

}  // namespace soil_survey
