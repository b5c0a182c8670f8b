// PeerNotes notifies this agent's StorageActor which records a session's destination has, and which records were sent
// to the destination. The notes are for display only and do not affect what is sent.
//
// The first note contains the destination's whole have-set, from its answer to a Hello. Later notes contain only the
// records that an acknowledgment added, so they stay small while the have-set grows for years.
//
// Notes are numbered. If storage missed a note (because storage was restarted, or its mailbox was full), it requests
// the whole have-set, and names the note that it could not use. All notes that one input of the session causes go into
// one PeerHave message. Plain value.
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
  // Requires: `first_number` is random, so storage does not mistake a note of an earlier process for the preceding
  // note.
  PeerNotes(proto::SharingKind kind, AgentId destination, std::uint64_t first_number);

  // Call when the session starts over. ObserveAllAgain then does nothing until the next call of ObserveAnswer.
  void StartOver() { is_answered_ = false; }
  // Adds a note with the destination's whole have-set, for the streams of `origins`, or for all streams if `origins` is
  // empty.
  void ObserveAnswer(const HaveSet& have, const std::set<AgentId>& origins, SharingActions& actions);
  // Adds a note with the records that `heard` covers and `known` does not. `known` is the have-set in earlier notes.
  // Adds no note if there are no such records.
  void ObserveAcknowledged(const HaveSet& heard, const HaveSet& known, SharingActions& actions);
  void ObserveHandedOver(const std::vector<RecordKey>& keys, SharingActions& actions) const;
  void ObserveClosed(SharingActions& actions) const;
  // Adds a note with the whole have-set and the records in flight, since storage could not use the note
  // `unused_number`. Does nothing if the destination has not answered yet, or if a later note contained the whole
  // have-set.
  void ObserveAllAgain(std::uint64_t unused_number, const HaveSet& have, const std::vector<RecordKey>& in_flight,
                       SharingActions& actions);

 private:
  proto::PeerHave& NoteIn(SharingActions& actions) const;
  // Returns the PeerHave message in `actions`, with the next number set.
  proto::PeerHave& NumberedNoteIn(SharingActions& actions);
  void ObserveAll(const HaveSet& have, SharingActions& actions);

  proto::SharingKind kind_;
  AgentId destination_;
  std::uint64_t number_;             // Number of the last note about the destination's have-set.
  std::uint64_t number_of_all_ = 0;  // Number of the last note that contained the whole have-set.
  bool is_answered_ = false;
  std::set<AgentId> origins_;  // The origins that the destination's last answer covers; empty: all.
};

}  // namespace moondb
