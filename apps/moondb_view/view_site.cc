#include "apps/moondb_view/view_site.h"

#include <algorithm>
#include <charconv>
#include <sstream>
#include <string_view>
#include <utility>

#include "apps/common/json_writer.h"
#include "apps/moonctl/map_questions.h"
#include "apps/moonctl/node_name.h"
#include "model/agent_name.h"

namespace moondb {
namespace {

struct PageFile {
  std::string_view path;
  std::string_view content_type;
  std::string_view content;
};

}  // namespace
}  // namespace moondb

#include "page_files.h"

namespace moondb {
namespace {

// Changes that come together are answered together.
constexpr auto kGathered = std::chrono::milliseconds(50);
// An answer without a change comes at most this much after its limit.
constexpr auto kLateMax = std::chrono::milliseconds(500);
constexpr auto kViewerWindow = std::chrono::seconds(5);

HttpResponse Json(unsigned status, std::string json) {
  return {status, "application/json", std::make_shared<const std::string>(std::move(json))};
}

HttpResponse Refusal(unsigned status, const std::string& text) {
  JsonWriter json;
  return Json(status,
              json.BeginObject().Key("error").BeginObject().Key("text").String(text).EndObject().EndObject().text());
}

template <typename T>
std::optional<T> NumberOf(const HttpRequest& request, const std::string& name) {
  const auto text = request.query.find(name);
  if (text == request.query.end()) return std::nullopt;
  T value{};
  const char* end = text->second.data() + text->second.size();
  const auto [stop, error] = std::from_chars(text->second.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

std::string WhyText(const proto::TeamConfig& team, const proto::MapWhyReply& why) {
  const std::string value = std::string("this cell is ") + CellValueName(why.value());
  if (why.observations().empty()) return value + ": no map knows it";
  const proto::MapObservation& winner = why.observations(0);
  const std::string node = NodeName(team, FromProto(winner.node()));
  if (winner.is_footprint()) return value + ", because " + AgentName(team, winner.node().agent_id()) + " stood there";
  const int others = why.observations_size() - 1;
  return value + " by the map of " + node +
         (others == 0 ? "; no other map knows it" : "; " + std::to_string(others) + " more know it");
}

std::string WhyJson(const proto::TeamConfig& team, const proto::MapWhyReply& why) {
  JsonWriter json;
  json.BeginObject().Key("value").String(CellValueName(why.value())).Key("x_m").Number(why.cell_x_m());
  json.Key("y_m").Number(why.cell_y_m()).Key("text").String(WhyText(team, why)).Key("observations").BeginArray();
  bool is_winner = true;  // The first one.
  for (const proto::MapObservation& said : why.observations()) {
    json.BeginObject().Key("value").String(CellValueName(said.value()));
    json.Key("agent").String(AgentName(team, said.node().agent_id())).Key("time_s");
    said.is_footprint() ? json.Null() : json.Number(static_cast<double>(said.timestamp_ns()) * 1e-9);
    json.Key("node").String(NodeName(team, FromProto(said.node()))).Key("resolution_m");
    said.is_footprint() ? json.Null() : json.Number(said.resolution_um() / 1e6);
    json.Key("remark").String(RemarkOn(said)).Key("is_winner").Bool(std::exchange(is_winner, false)).EndObject();
  }
  return json.EndArray().Key("left_out").Number(why.left_out_count()).EndObject().text();
}

}  // namespace

ViewSite::ViewSite(const proto::TeamConfig& team, Board& board)
    : team_(team), board_(board), thread_([this] { RespondToChanges(); }) {}

void ViewSite::UseWatch(AgentWatch& watch) {
  const std::lock_guard lock(mutex_);
  watch_ = &watch;
}

void ViewSite::End() {
  {
    const std::lock_guard lock(mutex_);
    if (std::exchange(is_ended_, true)) return;
    watch_ = nullptr;
  }
  board_.End();
  thread_.join();
  const std::lock_guard lock(mutex_);
  waiting_.clear();
}

std::uint64_t ViewSite::viewers() const {
  const std::lock_guard lock(mutex_);
  std::uint64_t most = waiting_.size();
  for (const auto& [time, count] : waited_) {
    if (Clock::now() - time < kViewerWindow) most = std::max(most, count);
  }
  return most;
}

void ViewSite::Handle(const HttpRequest& request, HttpServer::Respond respond) {
  if (request.path == "/api/ask") return HandleAsk(request, respond);
  if (request.method != "GET" && request.method != "HEAD") return respond(Refusal(405, "only GET is allowed here"));
  if (request.path == "/api/changes") return HandleChanges(request, std::move(respond));
  if (request.path == "/api/why") return HandleWhy(request, std::move(respond));
  if (request.path == "/tiles") return HandleTiles(request, respond);
  if (request.path.starts_with("/api/")) {
    const Board::Bytes part = board_.Find(request.path.substr(5));
    if (part == nullptr) return respond(Refusal(404, "this part of the page does not exist yet"));
    return respond({200, "application/json", part, true});
  }
  const auto file = std::ranges::find(kPageFiles, request.path, &PageFile::path);
  if (file == std::end(kPageFiles)) return respond(Refusal(404, "there is no such page"));
  respond({200, std::string(file->content_type), std::make_shared<const std::string>(file->content)});
}

void ViewSite::HandleTiles(const HttpRequest& request, const HttpServer::Respond& respond) {
  const auto at = request.query.find("at");
  std::vector<std::pair<std::int64_t, std::int64_t>> places;
  std::istringstream numbers(at == request.query.end() ? "" : at->second);
  char comma = 0;
  for (std::int64_t x = 0, y = 0; numbers >> x >> comma >> y; numbers >> comma) places.emplace_back(x, y);
  const auto map = NumberOf<std::uint64_t>(request, "map");
  if (places.empty() || !map) return respond(Refusal(400, "expected /tiles?map=ID&at=X,Y;X,Y"));
  respond({200, "application/octet-stream",
           std::make_shared<const std::string>(Deflate(board_.FindTiles(*map, places))), true});
}

void ViewSite::HandleChanges(const HttpRequest& request, HttpServer::Respond respond) {
  const auto since = NumberOf<std::uint64_t>(request, "since");
  if (!since) return respond(Refusal(400, "expected /api/changes?since=NUMBER"));
  if (viewers() == 0) {
    const std::lock_guard lock(mutex_);
    if (watch_ != nullptr) watch_->Wake();
  }
  if (board_.version() > *since) {
    SetViewers(1);
    return respond(Json(200, board_.ChangesJson(*since)));
  }
  {
    const std::lock_guard lock(mutex_);
    if (is_ended_) return;
    waiting_.push_back({*since, Clock::now() + kChangesWaitMax, std::move(respond)});
  }
  SetViewers(0);
}

void ViewSite::SetViewers(std::uint64_t more) {
  const std::lock_guard lock(mutex_);
  waited_.emplace_back(Clock::now(), waiting_.size() + more);
  while (waited_.size() > kWaitedMax) waited_.pop_front();
}

void ViewSite::RespondToChanges() {
  while (true) {
    const std::uint64_t version = board_.version();
    std::vector<Waiting> due;
    {
      const std::lock_guard lock(mutex_);
      if (is_ended_) return;
      for (auto waiting = waiting_.begin(); waiting != waiting_.end();) {
        const auto next = std::next(waiting);
        if (version > waiting->since || Clock::now() >= waiting->end) {
          due.push_back(std::move(*waiting));
          waiting_.erase(waiting);
        }
        waiting = next;
      }
    }
    for (Waiting& waiting : due) waiting.respond(Json(200, board_.ChangesJson(waiting.since)));
    board_.WaitForChange(version, Clock::now() + kLateMax);
    std::this_thread::sleep_for(kGathered);
  }
}

void ViewSite::HandleWhy(const HttpRequest& request, HttpServer::Respond respond) {
  const auto x = NumberOf<double>(request, "x");
  const auto y = NumberOf<double>(request, "y");
  if (!x || !y) return respond(Refusal(400, "expected /api/why?x=METRES&y=METRES"));
  const std::lock_guard lock(mutex_);
  if (watch_ == nullptr) return respond(Refusal(503, "the program is starting or stopping"));
  const bool is_taken = watch_->Ask([this, x = *x, y = *y, respond](const Result<Client*>& client) {
    const auto why = client ? (*client)->MapWhy(x, y) : tl::unexpected(client.error());
    respond(why ? Json(200, WhyJson(team_, *why)) : Refusal(502, ToString(why.error())));
  });
  if (!is_taken) respond(Refusal(503, "too many requests wait for the agent; try again"));
}

void ViewSite::HandleAsk(const HttpRequest& request, const HttpServer::Respond& respond) {
  const bool is_on = request.body == "{\"is_on\":true}";
  // Another site's page cannot send this type without being asked first (CORS).
  if (request.method != "POST" || request.content_type != "application/json" ||
      (!is_on && request.body != "{\"is_on\":false}")) {
    return respond(Refusal(400, "expected POST with {\"is_on\":true} or {\"is_on\":false} as application/json"));
  }
  const std::lock_guard lock(mutex_);
  if (watch_ == nullptr) return respond(Refusal(503, "the program is starting or stopping"));
  watch_->RequestTeam(is_on);
  respond(Json(200, request.body));
}

}  // namespace moondb
