// PeerNotes: what a session notes with its own StorageActor of its destination: what it has, what was handed over.
//
// All that it has is noted when it answers a Hello, then only what is news, with the acknowledgment that brought it. So
// a note is as large as what a batch changed and not as the have-set, which grows with epochs and gaps for years.
// Notes are numbered: storage that lacks the one before a difference (it was made anew, or could not take that one)
// asks for all again, and until then shows what it knew. A note's number is its message's request_id too, so that
// storage's request says which one it could not use: one request is answered of several that an answer overtakes.
//
// All that one step of the session notes is one PeerHave among its actions. A plain value; the notes decide nothing.
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
  // `first_number` is random: a note of an earlier process is not taken for the one before.
  PeerNotes(proto::SharingKind kind, AgentId destination, std::uint64_t first_number);

  // The destination is asked anew: what it said before is no answer to that.
  void StartOver() { is_answered_ = false; }
  // It has this, of the streams of `origins`, or of all if that is empty.
  void NoteAnswer(const HaveSet& have, const std::set<AgentId>& origins, SharingActions& actions);
  // It has `heard`, of which `known` was noted. Nothing is noted where that holds all of it.
  void NoteAcknowledged(const HaveSet& heard, const HaveSet& known, SharingActions& actions);
  void NoteHandedOver(const std::vector<RecordKey>& keys, SharingActions& actions) const;
  void NoteClosed(SharingActions& actions) const;
  // Storage could not use the note of that number. Nothing before the destination has answered, and where all was noted
  // since.
  void NoteAllAgain(std::uint64_t unused_number, const HaveSet& have, const std::vector<RecordKey>& in_flight,
                    SharingActions& actions);

 private:
  proto::PeerHave& NoteIn(SharingActions& actions) const;
  // The note of this step, under the next number.
  proto::PeerHave& NumberedNoteIn(SharingActions& actions);
  void NoteAll(const HaveSet& have, SharingActions& actions);

  proto::SharingKind kind_;
  AgentId destination_;
  std::uint64_t number_;             // The number of the last note that said what the destination has.
  std::uint64_t number_of_all_ = 0;  // The number of the last note that said all.
  bool is_answered_ = false;
  std::set<AgentId> origins_;  // The last answer's.
};

}  // namespace moondb
