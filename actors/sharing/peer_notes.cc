#include "actors/sharing/peer_notes.h"

#include <algorithm>
#include <utility>

namespace moondb {
namespace {

// Returns the records that `heard` covers and `known` does not. A record in `known` that the destination has since
// dropped is not included, because a PeerHave note does not distinguish held from dropped records.
HaveSet NewsOf(const HaveSet& heard, const HaveSet& known) {
  HaveSet news;
  for (const auto& [key, stream] : heard.streams()) {
    IntervalSet added = stream.Covered().Minus(known.Get(key).Covered());
    if (!added.is_empty()) news[key].held = std::move(added);
  }
  return news;
}

// Returns the PeerHave message in `actions`. Adds the message if there is none yet.
proto::Message& MessageIn(SharingActions& actions) {
  const auto note = std::find_if(actions.begin(), actions.end(),
                                 [](const SharingAction& action) { return action.message.has_peer_have(); });
  if (note != actions.end()) return note->message;
  proto::Message& added = actions.emplace_back().message;
  added.set_ms_type(proto::EVENT);
  added.mutable_peer_have();
  return added;
}

}  // namespace

PeerNotes::PeerNotes(proto::SharingKind kind, AgentId destination, std::uint64_t first_number)
    : kind_(kind), destination_(destination), number_(first_number) {}

void PeerNotes::ObserveAnswer(const HaveSet& have, const std::set<AgentId>& origins, SharingActions& actions) {
  is_answered_ = true;
  origins_ = origins;
  ObserveAll(have, actions);
}

void PeerNotes::ObserveAcknowledged(const HaveSet& heard, const HaveSet& known, SharingActions& actions) {
  const HaveSet news = NewsOf(heard, known);
  if (news.streams().empty()) return;
  proto::PeerHave& note = NumberedNoteIn(actions);
  note.set_is_difference(true);
  *note.mutable_acknowledged() = ToProto(news);
}

void PeerNotes::ObserveHandedOver(const std::vector<RecordKey>& keys, SharingActions& actions) const {
  if (keys.empty()) return;
  proto::PeerHave& note = NoteIn(actions);
  for (const RecordKey& key : keys) *note.add_handed_over() = ToProto(key);
}

void PeerNotes::ObserveClosed(SharingActions& actions) const { NoteIn(actions).set_is_session_closed(true); }

void PeerNotes::ObserveAllAgain(std::uint64_t unused_number, const HaveSet& have,
                                const std::vector<RecordKey>& in_flight, SharingActions& actions) {
  if (!is_answered_ || unused_number < number_of_all_) return;
  ObserveAll(have, actions);
  ObserveHandedOver(in_flight, actions);
}

void PeerNotes::ObserveAll(const HaveSet& have, SharingActions& actions) {
  proto::PeerHave& note = NumberedNoteIn(actions);
  number_of_all_ = number_;
  *note.mutable_acknowledged() = ToProto(have);
  *note.mutable_origin_agents() = {origins_.begin(), origins_.end()};
}

proto::PeerHave& PeerNotes::NoteIn(SharingActions& actions) const {
  proto::PeerHave& note = *MessageIn(actions).mutable_peer_have();
  note.set_peer(destination_);
  note.set_kind(kind_);
  return note;
}

proto::PeerHave& PeerNotes::NumberedNoteIn(SharingActions& actions) {
  MessageIn(actions).set_request_id(++number_);
  proto::PeerHave& note = NoteIn(actions);
  note.set_number(number_);
  return note;
}

}  // namespace moondb
