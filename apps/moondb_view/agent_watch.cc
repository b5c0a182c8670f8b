#include "apps/moondb_view/agent_watch.h"

#include <algorithm>
#include <utility>

#include "apps/common/json_writer.h"
#include "apps/common/utc.h"
#include "apps/moondb_view/graph_book.h"
#include "client/record_feed.h"
#include "model/agent_name.h"
#include "proto/share_status.pb.h"
#include "proto/status.pb.h"
#include "proto/types.pb.h"
#include "views/event_view.h"

namespace moondb {
namespace {

constexpr auto kRetryAfter = std::chrono::seconds(1);
constexpr auto kStatePeriod = std::chrono::seconds(1);
constexpr auto kIdleStatePeriod = std::chrono::seconds(10);  // While nobody looks.
constexpr auto kTimelinePeriod = std::chrono::seconds(5);
constexpr auto kBatteryPeriod = std::chrono::seconds(10);
constexpr auto kGraphPeriod = std::chrono::seconds(1);
constexpr auto kPageWait = std::chrono::milliseconds(500);
constexpr auto kIdlePageWait = std::chrono::seconds(3);  // The end of the program may take this long.
constexpr double kMapWait_s = 3;
constexpr std::uint32_t kEventsMax = 500;
constexpr double kRequestBytes = 100;  // Size of the three requests to another agent, about.

double SecondsSince(std::chrono::steady_clock::time_point time) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - time).count();
}

const char* SeverityName(Severity severity) {
  return severity == Severity::kError ? "error" : severity == Severity::kWarning ? "warning" : "info";
}

std::string EventsJson(const proto::TeamConfig& team, const std::vector<EventView>& events) {
  JsonWriter json;
  json.BeginObject().Key("events").BeginArray();
  for (const EventView& event : events) {
    json.BeginObject().Key("time_s").Number(static_cast<double>(event.timestamp_ns) * 1e-9);
    json.Key("agent").String(AgentName(team, event.agent)).Key("severity").String(SeverityName(event.severity));
    json.Key("kind").String(event.kind).Key("text").String(event.text).Key("by").String(event.by).EndObject();
  }
  return json.EndArray().EndObject().text();
}

}  // namespace

AgentWatch::AgentWatch(Options options, const proto::TeamConfig& team, AgentId agent, Board& board,
                       FoxgloveFeed& foxglove)
    : options_(std::move(options)), team_(team), agent_(agent), board_(board), foxglove_(foxglove) {
  threads_.emplace_back([this] { Repeat("states", [this](Client& client) { return FollowStates(client); }); });
  threads_.emplace_back([this] { Repeat("pose graph", [this](Client& client) { return FollowGraph(client); }); });
  threads_.emplace_back([this] { Repeat("map", [this](Client& client) { return FollowMap(client); }); });
  threads_.emplace_back([this] { Repeat("events", [this](Client& client) { return FollowEvents(client); }); });
  threads_.emplace_back([this] { RequestOthers(); });
  threads_.emplace_back([this] { AnswerQuestions(); });
}

AgentWatch::~AgentWatch() {
  {
    const std::lock_guard lock(mutex_);
    is_ended_ = true;
  }
  woken_.notify_all();
  for (std::thread& thread : threads_) thread.join();
}

bool AgentWatch::is_ended() const {
  const std::lock_guard lock(mutex_);
  return is_ended_;
}

bool AgentWatch::WaitFor(std::chrono::milliseconds duration) {
  std::unique_lock lock(mutex_);
  return woken_.wait_for(lock, duration, [this] { return is_ended_; });
}

CommandContext AgentWatch::MakeContext() const {
  CommandContext context(options_.program_folder);
  context.team_path = options_.team_path;
  context.key_file = options_.key_file;
  return context;
}

void AgentWatch::Repeat(const char* name, const std::function<Result<void>(Client&)>& work) {
  CommandContext context = MakeContext();
  std::string said;
  do {
    auto connected = context.ConnectHere(options_.agent);
    const Result<void> done = connected ? work(*connected->client) : tl::unexpected(connected.error());
    if (done) return;  // The object ends.
    if (std::exchange(said, done.error().text) != done.error().text) {
      options_.on_remark(std::string(name) + ": " + ToString(done.error()) + "; trying again each second");
    }
  } while (!WaitFor(kRetryAfter));
}

Result<ReportedAgent> AgentWatch::ReportOf(Client& client, double* bytes) const {
  ReportedAgent reported;
  Result<proto::AgentStatus> status = client.Status();
  if (!status) return tl::unexpected(status.error());
  Result<proto::ShareStatus> shares = client.ShareStatus();
  if (!shares) return tl::unexpected(shares.error());
  const Result<HaveSet> holds = client.GetHaveSet();
  if (!holds) return tl::unexpected(holds.error());
  *bytes += static_cast<double>(status->ByteSizeLong() + shares->ByteSizeLong() + ToProto(*holds).ByteSizeLong());
  if (status->role() == proto::ROLE_LEADER) {
    if (auto graph = client.GraphStats()) {
      reported.report.last_solve = graph->last_solve();
      reported.graph = *std::move(graph);
    }
    if (auto map = client.MapStats()) reported.report.map_stats = *std::move(map);
    if (auto matches = client.Registration()) reported.report.registration = *std::move(matches);
  }
  reported.report.status = *std::move(status);
  reported.report.shares = *std::move(shares);
  reported.holds = *holds;
  return reported;
}

void AgentWatch::Store(AgentId agent, Result<ReportedAgent> reported) {
  const std::lock_guard lock(mutex_);
  if (agent == agent_) why_silent_ = reported ? "" : ToString(reported.error());
  if (reported) answers_[agent] = {*std::move(reported), Clock::now()};
}

Result<void> AgentWatch::FollowStates(Client& client) {
  Clock::time_point batteries_at{};
  while (true) {
    double bytes = 0;
    Result<ReportedAgent> reported = ReportOf(client, &bytes);
    const Result<void> failure = reported ? Result<void>() : tl::unexpected(reported.error());
    Store(agent_, std::move(reported));
    if (failure && Clock::now() - batteries_at > kBatteryPeriod) {
      batteries_at = Clock::now();
      if (const auto read = ReadBatteries(client); !read) return read;
    }
    {
      const std::lock_guard lock(mutex_);
      if (failure) answer_bytes_ = bytes;
    }
    PublishTeam();
    if (!failure) return failure;
    const auto period = options_.viewers() > 0 ? kStatePeriod : kIdleStatePeriod;
    std::unique_lock lock(mutex_);
    (void)woken_.wait_for(lock, period, [this] { return is_ended_ || std::exchange(is_woken_, false); });
    if (is_ended_) return {};
  }
}

Result<void> AgentWatch::ReadBatteries(Client& client) {
  for (const proto::AgentConfig& agent : team_.agents()) {
    proto::ReadRequest request;
    request.add_data_types(proto::POWER);
    request.add_origin_agents(agent.id());
    request.set_is_newest_first(true);
    request.set_records_max(1);
    const Result<proto::ReadReply> page = client.Read(request);
    if (!page) return tl::unexpected(page.error());
    proto::Record record;
    if (page->records().empty() || !record.ParseFromString(page->records(0).content())) continue;
    Battery battery;
    if (record.power().presence_case() == proto::Power::kBatteryRatio) battery.ratio = record.power().battery_ratio();
    battery.timestamp_ns = record.timestamp_ns();
    const std::lock_guard lock(mutex_);
    batteries_[agent.id()] = battery;
  }
  return {};
}

void AgentWatch::PublishTeam() {
  TeamReports reports;
  reports.agent = agent_;
  reports.viewers = options_.viewers();
  const std::int64_t now_ns = UtcNowNs();
  reports.now_s = static_cast<double>(now_ns) * 1e-9;
  std::string timeline;
  {
    const std::lock_guard lock(mutex_);
    reports.why_silent = why_silent_;
    for (const auto& [agent, answers] : answers_) {
      reports.agents[agent] = answers.reported;
      reports.agents[agent].age_s = SecondsSince(answers.at);
    }
    for (const auto& [agent, battery] : batteries_) {
      reports.batteries[agent] = {battery.ratio, static_cast<double>(now_ns - battery.timestamp_ns) * 1e-9};
    }
    reports.is_placed = is_placed_;
    const auto others = static_cast<double>(team_.agents_size() - 1);
    reports.ask = {asks_team_, others * (answer_bytes_ + kRequestBytes), spent_bytes_,
                   std::chrono::duration<double>(options_.ask_period).count(), asks_team_ ? ask_trouble_ : ""};
    timeline_.Add(reports.now_s, TimelineCountsOf(team_, reports));
    if (Clock::now() - timeline_at_ > kTimelinePeriod) {
      timeline_at_ = Clock::now();
      timeline = timeline_.Json(team_);
    }
  }
  const std::string json = TeamPageJson(team_, reports);
  board_.Set("team", json);
  foxglove_.SetTeam(json);
  if (!timeline.empty()) board_.Set("timeline", timeline);
}

Result<void> AgentWatch::FollowGraph(Client& client) {
  proto::ReadRequest filter;
  for (const DataType type : {proto::ROLE_ASSIGNMENT, proto::POSE_GRAPH_NODE, proto::POSE_GRAPH_EDGE, proto::POSE_PRIOR,
                              proto::MAP_MATCH, proto::OPTIMIZED_POSE, proto::EDGE_VERDICT, proto::MAP_QUARANTINE}) {
    filter.add_data_types(type);
  }
  filter.set_records_max(1024);
  GraphBook book(team_);
  // All role assignments are read before the first other records: they decide which ones are valid.
  proto::ReadRequest roles;
  roles.add_data_types(proto::ROLE_ASSIGNMENT);
  const auto add_roles = [&book](const proto::StoredRecord& stored, const proto::Record& record) -> Result<void> {
    book.Add(FromProto(stored.key()), record);
    return {};
  };
  if (const auto read = client.ReadAll(roles, add_roles); !read) return read;
  RecordFeed feed(client, filter);
  bool is_changed = true;
  Clock::time_point written_at{};
  Clock::duration written_for{};
  while (true) {
    const Result<proto::ReadReply> page = feed.Next(is_changed ? kPageWait : kIdlePageWait);
    if (!page) return tl::unexpected(page.error());
    if (is_ended()) return {};
    for (const proto::StoredRecord& stored : page->records()) {
      proto::Record record;
      if (!record.ParseFromString(stored.content())) continue;
      book.Add(FromProto(stored.key()), record);
      is_changed = true;
    }
    if (book.TakeOutdated()) return Fail(ErrorCode::kUnavailable, "the roles changed; reading the graph again");
    // Large graphs are written less often. All pages that are there already are read first.
    const bool is_due = Clock::now() - written_at > std::max<Clock::duration>(kGraphPeriod, 10 * written_for);
    if (!is_changed || !page->is_complete() || !is_due) continue;
    is_changed = false;
    written_at = Clock::now();
    const GraphView view = book.View();
    board_.Set("poses", PosesJson(team_, view));
    board_.Set("lines", LinesJson(team_, view));
    foxglove_.SetGraph(view);
    written_for = Clock::now() - written_at;
    const std::lock_guard lock(mutex_);
    for (const auto& [track, is_placed] : view.tracks) is_placed_[track.agent] = is_placed;
  }
}

Result<void> AgentWatch::FollowMap(Client& client) {
  proto::MapTilesRequest request;
  BoardMap map;
  while (true) {
    request.set_wait_s(kMapWait_s);
    const Result<MergedTiles> tiles = client.NextMapTiles(request);
    if (!tiles) return tl::unexpected(tiles.error());
    if (is_ended()) return {};
    BoardMap now = map;
    if (!tiles->tiles.empty()) {
      const MergedMap& tile = tiles->tiles.front().map;
      now.resolution_um = tile.resolution_um;
      now.tile_cells = static_cast<std::uint32_t>(tile.grid.width);
    }
    now.frame_of = tiles->frame_of == 0 ? "" : AgentName(team_, tiles->frame_of);
    // Before the first tile, the size of cells is not known.
    if (now.tile_cells > 0 && (tiles->is_everything || now != map)) {
      board_.BeginMap(now);
      foxglove_.BeginMap(tiles->frame_of);
    }
    map = now;
    for (const MergedTile& tile : tiles->tiles) {
      const std::vector<Cell>& cells = tile.map.grid.cells;
      board_.SetTile(tile.x, tile.y, std::string(reinterpret_cast<const char*>(cells.data()), cells.size()));
    }
    foxglove_.SetTiles(tiles->tiles);
  }
}

Result<void> AgentWatch::FollowEvents(Client& client) {
  proto::ReadRequest newest;
  newest.add_data_types(proto::AGENT_EVENT);
  RecordFeed feed(client, newest);
  if (const auto skipped = feed.SkipToNow(); !skipped) return skipped;
  newest.set_is_newest_first(true);
  newest.set_records_max(kEventsMax);
  while (true) {
    const Result<proto::ReadReply> page = client.Read(newest);
    if (!page) return tl::unexpected(page.error());
    std::vector<EventView> events;
    for (const proto::StoredRecord& stored : page->records()) {
      proto::Record record;
      if (record.ParseFromString(stored.content()) && record.has_agent_event()) {
        events.push_back(EventViewOf(FromProto(stored.key()), record));
      }
    }
    std::ranges::stable_sort(events, std::greater(), &EventView::timestamp_ns);
    board_.Set("events", EventsJson(team_, events));
    foxglove_.AddEvents(events);
    while (true) {
      const Result<proto::ReadReply> news = feed.Next(kIdlePageWait);
      if (!news) return tl::unexpected(news.error());
      if (is_ended()) return {};
      if (!news->records().empty()) break;
    }
  }
}

void AgentWatch::RequestTeam(bool is_on) {
  {
    const std::lock_guard lock(mutex_);
    asks_team_ = is_on;
  }
  Wake();
}

void AgentWatch::Wake() {
  {
    const std::lock_guard lock(mutex_);
    is_woken_ = true;
  }
  woken_.notify_all();
}

void AgentWatch::RequestOthers() {
  while (true) {
    {
      std::unique_lock lock(mutex_);
      woken_.wait(lock, [this] { return is_ended_ || asks_team_; });
      if (is_ended_) return;
    }
    std::optional<HaveSet> own_holds;
    {
      const std::lock_guard lock(mutex_);
      if (answers_.contains(agent_)) own_holds = answers_.at(agent_).reported.holds;
    }
    CommandContext context = MakeContext();
    std::string trouble;
    for (const proto::AgentConfig& agent : team_.agents()) {
      if (agent.left() || agent.id() == agent_ || is_ended()) continue;
      const auto connected = context.Connect(agent.name());
      double bytes = 0;
      Result<ReportedAgent> reported =
          connected ? ReportOf(*connected->client, &bytes) : tl::unexpected(connected.error());
      if (!reported) trouble += (trouble.empty() ? "" : "; ") + agent.name() + ": " + reported.error().text;
      if (connected && connected->via != nullptr) {
        const std::lock_guard lock(mutex_);
        spent_bytes_ += bytes + kRequestBytes;
      }
      if (reported) reported->own_holds_then = own_holds;
      Store(agent.id(), std::move(reported));
    }
    std::unique_lock lock(mutex_);
    ask_trouble_ = trouble;
    (void)woken_.wait_for(lock, options_.ask_period, [this] { return is_ended_ || !asks_team_; });
  }
}

bool AgentWatch::Ask(std::function<void(Result<Client*>)> ask) {
  {
    const std::lock_guard lock(mutex_);
    if (questions_.size() >= kQuestionsMax) return false;
    questions_.push_back(std::move(ask));
  }
  woken_.notify_all();
  return true;
}

void AgentWatch::AnswerQuestions() {
  CommandContext context = MakeContext();
  while (true) {
    std::function<void(Result<Client*>)> question;
    {
      std::unique_lock lock(mutex_);
      woken_.wait(lock, [this] { return is_ended_ || !questions_.empty(); });
      if (is_ended_) return questions_.clear();
      question = std::move(questions_.front());
      questions_.pop_front();
    }
    auto connected = context.ConnectHere(options_.agent);
    question(connected ? Result<Client*>(connected->client.get()) : tl::unexpected(connected.error()));
  }
}

}  // namespace moondb
