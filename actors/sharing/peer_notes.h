// PeerNotes: notifies this agent's StorageActor of the state of a session's destination: which records it has, and
// which were handed over to it.
//
// The first note contains the destination's whole have-set, from its answer to a Hello. Later notes contain only the
// difference that an acknowledgment reported. A note is therefore as large as the change of one batch. The have-set
// itself grows for years, with epochs and gaps.
//
// Notes are numbered. Storage that misses the note before a difference (it was restarted, or its mailbox was full) asks
// for the whole have-set again, and shows the last known state until then. The number of a note is also its message's
// request_id, so storage's request names the note that it could not use. Requests that name a note from before the last
// whole have-set are ignored.
//
// All notes of one step of the session go into one PeerHave message. The notes are for display only and do not affect
// what is sent. Plain value.
#pragma once

#include <cstdint>
#include <set>
#include <vector>

#include "actors/sharing/sharing_action.h"
#include "model/have_set.h"
#include "proto/sharing.pb.h"

namespace moondb {

class PeerNotes {
 public:
  // `first_number` is random, so storage does not mistake a note of an earlier process for the preceding one.
  PeerNotes(proto::SharingKind kind, AgentId destination, std::uint64_t first_number);

  // The session sends a new Hello. The destination's earlier answers do not count as an answer to it.
  void StartOver() { is_answered_ = false; }
  // Notes the destination's whole have-set, for the streams of `origins`, or for all streams if `origins` is empty.
  void NoteAnswer(const HaveSet& have, const std::set<AgentId>& origins, SharingActions& actions);
  // Notes the records that `heard` has beyond `known`, which storage was already notified of. Notes nothing if there
  // are none.
  void NoteAcknowledged(const HaveSet& heard, const HaveSet& known, SharingActions& actions);
  void NoteHandedOver(const std::vector<RecordKey>& keys, SharingActions& actions) const;
  void NoteClosed(SharingActions& actions) const;
  // Notes the whole have-set and the records in flight again, since storage could not use the note `unused_number`.
  // Does nothing if the destination has not answered yet, or if the whole have-set was noted after that number.
  void NoteAllAgain(std::uint64_t unused_number, const HaveSet& have, const std::vector<RecordKey>& in_flight,
                    SharingActions& actions);

 private:
  proto::PeerHave& NoteIn(SharingActions& actions) const;
  // Returns the note of this step, with the next number.
  proto::PeerHave& NumberedNoteIn(SharingActions& actions);
  void NoteAll(const HaveSet& have, SharingActions& actions);

  proto::SharingKind kind_;
  AgentId destination_;
  std::uint64_t number_;             // Number of the last note about the destination's have-set.
  std::uint64_t number_of_all_ = 0;  // Number of the last note that contained the whole have-set.
  bool is_answered_ = false;
  std::set<AgentId> origins_;  // The origins that the destination's last answer covers; empty: all.
};

}  // namespace moondb
