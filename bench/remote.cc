#include <array>
#include <string>

#include "bench/cases.h"
#include "bench/remote_moondb.h"
#include "bench/remote_raw.h"

namespace moondb {
namespace {

constexpr std::array<std::size_t, 2> kMessageBytes = {100, 1000};
constexpr std::uint64_t kThroughputShare = 20;
constexpr std::uint64_t kRoundTripShare = 500;

using Remote = Result<double> (*)(bool is_curve, std::size_t bytes, std::uint64_t count);
using Raw = Result<double> (*)(RawSockets sockets, bool is_curve, std::size_t bytes, std::uint64_t count);

std::vector<Contender> Contenders(Remote moondb, Raw raw, bool is_curve, std::size_t bytes) {
  const auto raw_with = [=](RawSockets sockets) -> Measure {
    return [=](std::uint64_t count) { return raw(sockets, is_curve, bytes, count); };
  };
  return {{"moondb", [=](std::uint64_t count) { return moondb(is_curve, bytes, count); }},
          {"raw", raw_with(RawSockets::kAsMoondb)},
          {"raw_defaults", raw_with(RawSockets::kDefaults)}};
}

}  // namespace

std::vector<BenchCase> RemoteCases() {
  std::vector<BenchCase> cases;
  for (const bool is_curve : {false, true}) {
    for (const std::size_t bytes : kMessageBytes) {
      const std::string name = std::string("remote_") + (is_curve ? "curve_" : "plain_") + std::to_string(bytes);
      cases.push_back(AsCase({name, "messages/s", ">= 0.7 x raw", kThroughputShare,
                              Contenders(MoondbRemoteThroughput, RawThroughput, is_curve, bytes)}));
      cases.push_back(AsCase({name + "_us", "us", is_curve ? "<= 1.5 x raw" : "<= 1.3 x raw", kRoundTripShare,
                              Contenders(MoondbRemoteRoundTrip, RawRoundTrip, is_curve, bytes)}));
    }
  }
  return cases;
}

}  // namespace moondb
