#include "model/event.h"

#include <algorithm>
#include <cctype>
#include <cmath>

#include "model/text.h"
#include "proto/status.pb.h"

namespace moondb {

namespace {

constexpr std::string_view kWasLost = " was lost";
constexpr std::string_view kIsBack = ", and is back";
constexpr std::string_view kUpToTimestamp = "up to timestamp ";

// Returns the subject of a finding. Findings with the same subject are merged. All losses and returns of one peer have
// the same subject. The subject of any other finding is its text.
std::string SubjectOf(const OwnEvent& event) {
  const std::size_t lost = event.kind == proto::EVENT_KIND_LOST ? event.text.find(kWasLost) : std::string::npos;
  return event.text.substr(0, lost);
}

bool IsFinding(proto::EventKind kind) { return kind == proto::EVENT_KIND_DAMAGE || kind == proto::EVENT_KIND_LOST; }

struct OpenFinding {
  std::string subject;
  std::string text;
  std::int64_t timestamp_ns = 0;
  int times = 0;
};

void AddTo(std::vector<OpenFinding>& open, const OwnEvent& event) {
  const std::string subject = SubjectOf(event);
  const bool is_return = event.text.ends_with(kIsBack);
  auto known = std::find_if(open.begin(), open.end(), [&](const OpenFinding& one) { return one.subject == subject; });
  if (known == open.end()) {
    if (is_return) return;  // The loss of this peer has been acknowledged already.
    known = open.insert(open.end(), OpenFinding{subject, {}, 0, 0});
  }
  known->text = event.text;
  known->timestamp_ns = event.timestamp_ns;
  if (!is_return) ++known->times;
}

std::string AwayText(double away_s) {
  if (away_s < 600) return std::to_string(std::llround(std::max(away_s, 0.0))) + " s";
  if (away_s < 36'000) return std::to_string(std::llround(away_s / 60)) + " min";
  return std::to_string(std::llround(away_s / 3600)) + " h";
}

// Cuts text to `bytes_max`. OneLine may exceed its limit by up to 8 bytes, because it adds a mark to a text that it
// cuts.
std::string Cut(std::string_view text, std::size_t bytes_max) { return OneLine(text, bytes_max - 8); }

}  // namespace

proto::Record MakeEvent(proto::EventKind kind, std::string_view text, std::string_view by, std::int64_t timestamp_ns) {
  proto::Record record;
  record.set_timestamp_ns(timestamp_ns);
  proto::AgentEvent& event = *record.mutable_agent_event();
  event.set_kind(kind);
  event.set_text(Cut(text, kEventTextBytesMax));
  event.set_by(Cut(by, kEventByBytesMax));
  return record;
}

std::string LostPeerText(const std::string& peer) { return peer + std::string(kWasLost); }

std::string BackPeerText(const std::string& peer, double away_s) {
  return LostPeerText(peer) + " for " + AwayText(away_s) + std::string(kIsBack);
}

bool SaysLost(const std::string& text, const std::string& peer) {
  const std::string lost = LostPeerText(peer);
  const bool is_of_peer = text.starts_with(lost) && (text.size() == lost.size() || text[lost.size()] == ' ');
  return is_of_peer && text.find(kIsBack) == std::string::npos;
}

std::string AcknowledgedText(std::int64_t until_ns, std::size_t count) {
  return std::to_string(count) + (count == 1 ? " finding was" : " findings were") + " acknowledged, " +
         std::string(kUpToTimestamp) + std::to_string(until_ns);
}

std::optional<std::int64_t> AcknowledgedUntil(const std::string& text) {
  const std::size_t at = text.find(kUpToTimestamp);
  if (at == std::string::npos) return std::nullopt;
  const auto until_ns = ParseUnsigned(std::string_view(text).substr(at + kUpToTimestamp.size()));
  if (!until_ns || *until_ns > static_cast<std::uint64_t>(INT64_MAX)) return std::nullopt;
  return static_cast<std::int64_t>(*until_ns);
}

std::vector<proto::HealthFinding> FindingsOf(const std::vector<OwnEvent>& events) {
  std::vector<OpenFinding> open;
  for (const OwnEvent& event : events) {
    if (IsFinding(event.kind)) AddTo(open, event);
    const auto until_ns = event.kind == proto::EVENT_KIND_ACKNOWLEDGED ? AcknowledgedUntil(event.text) : std::nullopt;
    if (until_ns) std::erase_if(open, [&](const OpenFinding& one) { return one.timestamp_ns <= *until_ns; });
  }
  std::stable_sort(open.begin(), open.end(),
                   [](const OpenFinding& a, const OpenFinding& b) { return a.timestamp_ns < b.timestamp_ns; });
  std::vector<proto::HealthFinding> findings;
  for (std::size_t i = open.size() - std::min(open.size(), kFindingsMax); i < open.size(); ++i) {
    proto::HealthFinding& finding = findings.emplace_back();
    finding.set_text(open[i].text);
    if (open[i].times > 1) finding.set_text(finding.text() + " (" + std::to_string(open[i].times) + " times)");
    finding.set_timestamp_ns(open[i].timestamp_ns);
  }
  return findings;
}

std::string EventKindName(proto::EventKind kind) {
  constexpr std::string_view kPrefix = "EVENT_KIND_";
  if (kind == proto::EVENT_KIND_UNSPECIFIED || !proto::EventKind_IsValid(kind)) return "unknown";
  std::string name = proto::EventKind_Name(kind).substr(kPrefix.size());
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
  return name;
}

}  // namespace moondb
