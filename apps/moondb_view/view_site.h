// ViewSite: the addresses of the page (docs/VIEW.md), over the board and the questions of an AgentWatch.
#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <list>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

#include "apps/moondb_view/agent_watch.h"
#include "apps/moondb_view/board.h"
#include "apps/moondb_view/http_server.h"

namespace moondb {

class ViewSite {
 public:
  static constexpr std::chrono::seconds kChangesWaitMax{20};

  // Requires: `board` outlives the site.
  explicit ViewSite(const proto::TeamConfig& team, Board& board);
  ~ViewSite() { End(); }
  ViewSite(const ViewSite&) = delete;
  ViewSite& operator=(const ViewSite&) = delete;

  // Answers questions from now on. Requires: `watch` exists until End.
  void UseWatch(AgentWatch& watch);
  // As HttpServer::Handler.
  void Handle(const HttpRequest& request, HttpServer::Respond respond);
  // Drops all requests that wait, and uses the watch no more. Call it before the server ends.
  void End();

  // Returns how many pages are open: requests for changes of the last seconds, by their connections.
  std::uint64_t viewers() const;

 private:
  using Clock = std::chrono::steady_clock;
  static constexpr std::size_t kWaitedMax = 256;
  struct Waiting {
    std::uint64_t since = 0;
    Clock::time_point end;
    HttpServer::Respond respond;
  };

  void HandleTiles(const HttpRequest& request, const HttpServer::Respond& respond);
  void HandleChanges(const HttpRequest& request, HttpServer::Respond respond);
  void HandleWhy(const HttpRequest& request, HttpServer::Respond respond);
  void HandleAsk(const HttpRequest& request, const HttpServer::Respond& respond);
  void SetViewers(std::uint64_t more);
  void RespondToChanges();

  const proto::TeamConfig& team_;
  Board& board_;
  mutable std::mutex mutex_;
  AgentWatch* watch_ = nullptr;
  bool is_ended_ = false;
  std::list<Waiting> waiting_;
  // How many requests for changes waited at some time, newest last.
  std::deque<std::pair<Clock::time_point, std::uint64_t>> waited_;
  std::thread thread_;
};

}  // namespace moondb
