// AgentWatch: follows one agent and keeps the board current, and asks it questions.
//
// The object reads from that agent alone, which costs no radio. Only while RequestTeam is on, it asks the other agents,
// once a period. Six threads: four that follow the agent, each with its own connection, because a call of Client
// blocks; one that asks the other agents; one that asks questions. Thread-safe.
#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "apps/moonctl/command_context.h"
#include "apps/moondb_view/board.h"
#include "apps/moondb_view/foxglove_feed.h"
#include "apps/moondb_view/team_page.h"
#include "apps/moondb_view/timeline.h"

namespace moondb {

class AgentWatch {
 public:
  static constexpr std::size_t kQuestionsMax = 16;  // Questions that wait; more are refused.

  struct Options {
    std::filesystem::path program_folder;  // As CommandContext.
    std::string team_path;
    std::string agent;
    std::string key_file;
    std::chrono::milliseconds ask_period = std::chrono::seconds(30);
    std::function<std::uint64_t()> viewers;                  // How many pages are open.
    std::function<void(const std::string& text)> on_remark;  // Called with what fails, once for each text.
  };

  // Requires: the team file names the agent. `board` and `foxglove` outlive the object.
  AgentWatch(Options options, const proto::TeamConfig& team, AgentId agent, Board& board, FoxgloveFeed& foxglove);
  ~AgentWatch();
  AgentWatch(const AgentWatch&) = delete;
  AgentWatch& operator=(const AgentWatch&) = delete;

  void RequestTeam(bool is_on);
  // Calls `ask` with a client of the agent, on another thread. Returns false if too many questions wait.
  bool Ask(std::function<void(Result<Client*>)> ask);
  // Wakes the reading of states, which is slow while nobody looks.
  void Wake();

 private:
  using Clock = std::chrono::steady_clock;
  struct Answers {
    ReportedAgent reported;
    Clock::time_point at;
  };
  struct Battery {
    std::optional<double> ratio;
    std::int64_t timestamp_ns = 0;
  };

  // Repeats `work` with a new connection after each failure. `name` begins the remark.
  void Repeat(const char* name, const std::function<Result<void>(Client&)>& work);
  bool is_ended() const;
  // Returns true if the object ends.
  bool WaitFor(std::chrono::milliseconds duration);
  CommandContext MakeContext() const;

  Result<void> FollowStates(Client& client);
  Result<void> FollowGraph(Client& client);
  Result<void> FollowMap(Client& client);
  Result<void> FollowEvents(Client& client);
  void RequestOthers();
  void AnswerQuestions();
  Result<void> ReadBatteries(Client& client);
  // Asks an agent for what the page shows. Adds the size of the answers to `bytes`.
  Result<ReportedAgent> ReportOf(Client& client, double* bytes) const;
  void Store(AgentId agent, Result<ReportedAgent> reported);
  void PublishTeam();

  const Options options_;
  const proto::TeamConfig& team_;
  const AgentId agent_;
  Board& board_;
  FoxgloveFeed& foxglove_;

  mutable std::mutex mutex_;
  std::condition_variable woken_;
  bool is_ended_ = false;
  bool is_woken_ = false;
  bool asks_team_ = false;
  std::string why_silent_ = "the first answer is still to come";
  std::map<AgentId, Answers> answers_;
  std::map<AgentId, Battery> batteries_;
  std::map<AgentId, bool> is_placed_;
  double answer_bytes_ = 0;  // Size of the own agent's last answers.
  double spent_bytes_ = 0;
  std::string ask_trouble_;  // RequestState::trouble.
  Timeline timeline_;
  Clock::time_point timeline_at_{};
  std::deque<std::function<void(Result<Client*>)>> questions_;
  std::vector<std::thread> threads_;
};

}  // namespace moondb
