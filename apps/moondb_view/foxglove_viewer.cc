#include "apps/moondb_view/foxglove_viewer.h"

#include <google/protobuf/util/json_util.h>

#include <utility>
#include <vector>

#include "apps/common/json_writer.h"
#include "apps/mcap/little_endian.h"
#include "model/text.h"
#include "proto/foxglove.pb.h"

namespace moondb {
namespace {

constexpr std::size_t kAdvertisedMax = 16;  // In one message.
constexpr std::uint8_t kMessageData = 1;

std::string Base64(const std::string& bytes) {
  constexpr char kDigits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t value = 0;
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    for (std::size_t k = 0; k < 3; ++k)
      value = value << 8 | (k < count ? static_cast<unsigned char>(bytes[i + k]) : 0u);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? kDigits[value >> (18 - 6 * k) & 63] : '=';
  }
  return text;
}

void WriteChannel(const Channel& channel, JsonWriter& json) {
  const bool is_protobuf = channel.encoding == "protobuf";
  json.BeginObject().Key("id").Number(channel.id).Key("topic").String(channel.topic);
  json.Key("encoding").String(channel.encoding).Key("schemaName").String(channel.schema_name);
  json.Key("schemaEncoding").String(is_protobuf ? "protobuf" : "jsonschema");
  json.Key("schema").String(is_protobuf ? Base64(channel.schema) : channel.schema).EndObject();
}

}  // namespace

FoxgloveViewer::FoxgloveViewer(Channels& channels, std::string name, std::string session_id, std::function<void()> wake)
    : channels_(channels),
      name_(std::move(name)),
      session_id_(std::move(session_id)),
      change_(channels.OnChange(std::move(wake))) {}

void FoxgloveViewer::Say(Level level, const std::string& text) {
  JsonWriter json;
  json.BeginObject().Key("op").String("status").Key("level").Number(static_cast<int>(level));
  json.Key("message").String(text).EndObject();
  if (statuses_.size() < kStatusesMax) statuses_.push_back(json.text());
}

void FoxgloveViewer::OnMessage(const Frame& frame) {
  if (frame.is_binary) return Say(Level::kError, "this server accepts no data from its viewers");
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  foxglove::ClientRequest request;
  if (!google::protobuf::util::JsonStringToMessage(frame.bytes, &request, options).ok()) {
    return Say(Level::kError, "a request is not a JSON object of this protocol");
  }
  if (request.op() == "subscribe") {
    for (const auto& wanted : request.subscriptions()) Subscribe(wanted.id(), wanted.channel_id());
  } else if (request.op() == "unsubscribe") {
    for (const std::uint32_t id : request.subscription_ids()) subscriptions_.erase(id);
  } else {
    Say(Level::kWarning, "the operation \"" + OneLine(request.op(), 64) + "\" is not supported");
  }
}

void FoxgloveViewer::Subscribe(std::uint32_t id, std::uint32_t channel) {
  if (!known_.contains(channel)) {
    return Say(Level::kWarning, "there is no channel " + std::to_string(channel));
  }
  if (subscriptions_.contains(id)) {
    return Say(Level::kWarning, "the subscription " + std::to_string(id) + " exists already");
  }
  if (subscriptions_.size() >= kSubscriptionsMax) return Say(Level::kError, "there are too many subscriptions");
  subscriptions_[id] = {channel, known_.at(channel), 0};
}

std::optional<SocketPeer::Frame> FoxgloveViewer::Next() {
  if (!std::exchange(has_info_, true)) {
    JsonWriter json;
    json.BeginObject().Key("op").String("serverInfo").Key("name").String(name_);
    json.Key("capabilities").BeginArray().EndArray().Key("supportedEncodings").BeginArray().EndArray();
    json.Key("metadata").BeginObject().EndObject().Key("sessionId").String(session_id_).EndObject();
    return Frame{json.text(), false};
  }
  if (!statuses_.empty()) {
    Frame frame{std::move(statuses_.front()), false};
    statuses_.pop_front();
    return frame;
  }
  if (auto list = NextList()) return list;
  return NextMessage();
}

std::optional<SocketPeer::Frame> FoxgloveViewer::NextList() {
  const std::uint64_t version = channels_.list_version();
  if (version == list_version_) return std::nullopt;
  const std::vector<Channel> all = channels_.List();
  std::set<std::uint32_t> removed;
  for (const auto& [id, is_bulk] : known_) removed.insert(id);
  JsonWriter made;
  made.BeginObject().Key("op").String("advertise").Key("channels").BeginArray();
  std::size_t count = 0;
  for (const Channel& channel : all) {
    removed.erase(channel.id);
    if (known_.contains(channel.id) || count == kAdvertisedMax) continue;
    ++count;
    known_[channel.id] = channel.is_bulk;
    WriteChannel(channel, made);
  }
  if (count > 0) return Frame{made.EndArray().EndObject().text(), false};
  list_version_ = version;
  if (removed.empty()) return std::nullopt;
  JsonWriter json;
  json.BeginObject().Key("op").String("unadvertise").Key("channelIds").BeginArray();
  for (const std::uint32_t id : removed) {
    known_.erase(id);
    json.Number(id);
    std::erase_if(subscriptions_, [id](const auto& subscription) { return subscription.second.channel == id; });
  }
  return Frame{json.EndArray().EndObject().text(), false};
}

std::optional<SocketPeer::Frame> FoxgloveViewer::NextMessage() {
  // The map has many channels. Without turns, the others would wait for all of them on a slow link.
  const bool is_bulk = !was_bulk_;
  std::optional<Frame> frame = NextMessageOf(is_bulk);
  was_bulk_ = frame ? is_bulk : !is_bulk;
  return frame ? frame : NextMessageOf(!is_bulk);
}

std::optional<SocketPeer::Frame> FoxgloveViewer::NextMessageOf(bool is_bulk) {
  // In turn, beginning behind the one that was served last.
  auto next = subscriptions_.upper_bound(last_sent_[is_bulk]);
  for (std::size_t i = 0; i < subscriptions_.size(); ++i, ++next) {
    if (next == subscriptions_.end()) next = subscriptions_.begin();
    auto& [id, subscription] = *next;
    if (subscription.is_bulk != is_bulk) continue;
    auto found = channels_.FindNext(subscription.channel, subscription.after);
    if (!found) continue;
    if (found->has_skipped) Say(Level::kWarning, "this connection is too slow: events were dropped");
    subscription.after = found->message.version;
    last_sent_[is_bulk] = id;
    Frame frame{std::string(1, static_cast<char>(kMessageData)), true};
    AppendLittleEndian(id, frame.bytes);
    AppendLittleEndian(found->message.log_time_ns, frame.bytes);
    frame.bytes += *found->message.payload;
    return frame;
  }
  return std::nullopt;
}

}  // namespace moondb
