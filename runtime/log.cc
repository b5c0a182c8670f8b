#include "runtime/log.h"

#include <google/protobuf/stubs/logging.h>
#include <spdlog/fmt/chrono.h>
#include <spdlog/formatter.h>
#include <spdlog/sinks/rotating_file_sink.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <memory>
#include <string_view>
#include <vector>

#include "model/did_you_mean.h"
#include "model/json_text.h"

namespace moondb {
namespace {

constexpr std::size_t kFileBytesMax = 10 * 1024 * 1024;
constexpr std::size_t kOldFilesMax = 3;
constexpr char kNameLetters[] = "abcdefghijklmnopqrstuvwxyz0123456789_-";

// Returns the name of the actor or component with which `text` begins, and removes the name from `text`. For example,
// returns "lease" for "lease: refused" and for "2/lease: refused". For "actor 2/lease failed", returns "lease" but
// leaves `text` unchanged. Returns "" if `text` begins with no such name.
std::string_view TakeActor(std::string_view* text) {
  constexpr std::string_view kActor = "actor ";
  const bool is_in_sentence = text->starts_with(kActor);
  std::string_view rest = *text;
  if (is_in_sentence) rest.remove_prefix(kActor.size());
  const std::size_t id_end = rest.find_first_not_of("0123456789");
  if (id_end != 0 && id_end != std::string_view::npos && rest[id_end] == '/') rest.remove_prefix(id_end + 1);
  const std::string_view name = rest.substr(0, rest.find_first_not_of(kNameLetters));
  rest.remove_prefix(name.size());
  if (!rest.starts_with(is_in_sentence ? " " : ": ")) return "";
  if (!is_in_sentence) *text = rest.substr(2);
  return name;
}

bool IsStderr(const std::string& file) {
  struct stat stderr_status {};
  struct stat file_status {};
  return ::fstat(STDERR_FILENO, &stderr_status) == 0 && ::stat(file.c_str(), &file_status) == 0 &&
         stderr_status.st_dev == file_status.st_dev && stderr_status.st_ino == file_status.st_ino;
}

class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& event, spdlog::memory_buf_t& line) override {
    const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(event.time.time_since_epoch()).count() % 1000;
    std::string_view text(event.payload.data(), event.payload.size());
    const std::string_view actor = TakeActor(&text);
    fmt::format_to(std::back_inserter(line), R"({{"time":"{:%Y-%m-%dT%H:%M:%S}.{:03}Z","level":"{}","agent":{})",
                   fmt::gmtime(std::chrono::system_clock::to_time_t(event.time)), ms,
                   fmt::string_view(spdlog::level::to_string_view(event.level).data()),
                   JsonString({event.logger_name.data(), event.logger_name.size()}));
    if (!actor.empty()) fmt::format_to(std::back_inserter(line), R"(,"actor":{})", JsonString(actor));
    fmt::format_to(std::back_inserter(line), ",\"text\":{}}}\n", JsonString(text));
  }
  std::unique_ptr<spdlog::formatter> clone() const override { return std::make_unique<JsonFormatter>(); }
};

}  // namespace

Result<void> InitLog(const std::string& level, const std::string& agent_name, const std::string& file,
                     LogFormat format) {
  const std::vector<std::string> levels = {"trace", "debug", "info", "warning", "error", "critical", "off"};
  const spdlog::level::level_enum chosen = spdlog::level::from_str(level);
  // spdlog maps an unknown word to "off".
  if (chosen == spdlog::level::off && level != "off") {
    return Fail(ErrorCode::kInvalid,
                "expected trace, debug, info, warning, error, critical or off, got \"" + level + "\"" +
                    DidYouMean(level, levels),
                "level");
  }
  try {
    std::vector<spdlog::sink_ptr> sinks;
    if (!file.empty()) {
      sinks.push_back(std::make_shared<spdlog::sinks::rotating_file_sink_mt>(file, kFileBytesMax, kOldFilesMax));
    }
    if (file.empty() || !IsStderr(file)) sinks.push_back(std::make_shared<spdlog::sinks::stderr_sink_mt>());
    auto logger = std::make_shared<spdlog::logger>(agent_name, sinks.begin(), sinks.end());
    if (format == LogFormat::kJson) {
      logger->set_formatter(std::make_unique<JsonFormatter>());
    } else {
      logger->set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %l %n %v", spdlog::pattern_time_type::utc);
    }
    logger->set_level(chosen);
    // Flush each event. Events are rare, and a crash must not lose the last ones.
    logger->flush_on(spdlog::level::trace);
    spdlog::set_default_logger(std::move(logger));
    // Protobuf would log each malformed message of a peer. Callers report parse errors themselves.
    google::protobuf::SetLogHandler(nullptr);
  } catch (const spdlog::spdlog_ex& error) {
    return Fail(ErrorCode::kUnavailable, std::string("cannot log: ") + error.what());
  }
  return {};
}

}  // namespace moondb
