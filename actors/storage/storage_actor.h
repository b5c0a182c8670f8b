// StorageActor: the one owner of an agent's database; answers what proto/storage.proto lets others ask.
//
// Thin: RecordStore does the work. Every reply comes after the commit that it speaks of. A failed write is an error in
// its reply, and the actor goes on; a file that cannot be opened fails the actor, and one that turns out to be damaged
// ends the process. So that damage is noticed while another disk still has what it costs, it reads through the whole
// store now and then (Options::scrub_period), as a process does at its start. Marks what is inserted while this agent's
// clock is suspect. Spawn it with a thread of its own: commits wait for the disk.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "actors/storage/clock_judge.h"
#include "actors/storage/record_store.h"
#include "proto/team.pb.h"
#include "runtime/actor.h"
#include "runtime/rate_limited_log.h"

namespace moondb {

class StorageActor final : public Actor {
 public:
  struct Options {
    std::string path;                 // The database file; its folder exists. ":memory:" for tests.
    std::string vfs;                  // Empty: the system's files. Else as of Database::Open.
    AgentId self = 0;                 // This agent, which is in `team`.
    proto::TeamConfig team;           // Checked; its agents, policies `share`, custom types and `retention` are read.
    std::vector<std::string> notify;  // Actors of this agent that get RecordsStored after each commit of new rows.
    std::uint64_t bytes_max = 0;      // Of the file; 0: as the disk allows.
    Duration written_period = std::chrono::minutes(1);  // Between two times of writing down what was written.
    Duration scrub_period = std::chrono::hours(24);     // From the end of a reading to the next one; zero: never.
    Duration scrub_pause = std::chrono::minutes(1);     // Between two parts of one, each kVerifyBytesMax at most.
    bool is_checked = false;  // As RecordStore::Options: the actor's restarts take no longer for a large file.
  };

  explicit StorageActor(Options options);
  ~StorageActor() override;

  // The same store as the actor's, for a check at a program's start: open it, show the error, close it again.
  static RecordStore::Options StoreOptions(const Options& options);

  void OnStart(Context& context) override;
  void OnMessage(Context& context, const proto::Message& message) override;

 private:
  void OnInsert(Context& context, const proto::InsertRequest& request);
  void OnStore(Context& context, const proto::StoreRequest& request);
  void OnMissing(Context& context, const proto::MissingRequest& request);
  void OnRead(Context& context, const proto::ReadRequest& request);
  void OnSaveRoles(Context& context, const proto::SaveRolesRequest& request);
  void OnLoadRoles(Context& context);
  void OnStatus(Context& context);
  void OnPrune(Context& context, const proto::PruneRequest& request);
  void OnVerify(Context& context, const proto::VerifyRequest& request);
  void OnFingerprint(Context& context, const proto::FingerprintRequest& request);
  void OnBundle(Context& context, const proto::Message& message);  // Any question about one.
  void Scrub(Context& context);
  void SaveWritten(Context& context);
  // Why there is little room left; empty: there is enough.
  std::string SpaceLow(const proto::StorageStatus& status) const;
  bool MoveScrubOn(const proto::VerifyReply& reply);  // Whether that was the last part.
  void Answer(Context& context, proto::Message reply);
  void Note(Context& context, const char* what, const Error& error);
  void FailIfDamaged(Context& context, const Error& error);
  void Notify(Context& context, const proto::RecordsStored& stored);
  // Whether what is inserted now must be marked.
  bool IsClockSuspect(Context& context);

  const Options options_;
  ClockJudge clock_judge_;
  std::string clock_suspect_;  // The last verdict.
  std::unique_ptr<RecordStore> store_;
  proto::VerifyRequest next_scrub_;
  RateLimitedLog rejected_log_;
};

}  // namespace moondb
