#include "runtime/log.h"

#include <google/protobuf/stubs/logging.h>
#include <spdlog/sinks/rotating_file_sink.h>
#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <memory>
#include <vector>

#include "runtime/did_you_mean.h"

namespace moondb {
namespace {

constexpr std::size_t kFileBytesMax = 10 * 1024 * 1024;
constexpr std::size_t kOldFilesMax = 3;

}  // namespace

Result<void> InitLog(const std::string& level, const std::string& agent_name, const std::string& file) {
  const std::vector<std::string> levels = {"trace", "debug", "info", "warning", "error", "critical", "off"};
  const spdlog::level::level_enum chosen = spdlog::level::from_str(level);
  // spdlog takes an unknown word for "off".
  if (chosen == spdlog::level::off && level != "off") {
    return Fail(ErrorCode::kInvalid,
                "expected trace, debug, info, warning, error, critical or off, got \"" + level + "\"" +
                    DidYouMean(level, levels),
                "level");
  }
  try {
    std::vector<spdlog::sink_ptr> sinks = {std::make_shared<spdlog::sinks::stderr_sink_mt>()};
    if (!file.empty()) {
      sinks.push_back(std::make_shared<spdlog::sinks::rotating_file_sink_mt>(file, kFileBytesMax, kOldFilesMax));
    }
    auto logger = std::make_shared<spdlog::logger>(agent_name, sinks.begin(), sinks.end());
    logger->set_pattern("%Y-%m-%dT%H:%M:%S.%eZ %l %n %v", spdlog::pattern_time_type::utc);
    logger->set_level(chosen);
    logger->flush_on(spdlog::level::trace);  // Events are rare, and a crash must not swallow the last ones.
    spdlog::set_default_logger(std::move(logger));
    google::protobuf::SetLogHandler(nullptr);  // It tells of each bad byte that a peer sends; whoever parses says so.
  } catch (const spdlog::spdlog_ex& error) {
    return Fail(ErrorCode::kUnavailable, std::string("cannot log: ") + error.what());
  }
  return {};
}

}  // namespace moondb
