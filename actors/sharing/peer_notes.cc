#include "actors/sharing/peer_notes.h"

#include <algorithm>
#include <utility>

namespace moondb {
namespace {

// Held or dropped is one to storage: what was had before and is dropped by now is no news.
HaveSet NewsOf(const HaveSet& heard, const HaveSet& known) {
  HaveSet news;
  for (const auto& [key, stream] : heard.streams()) {
    IntervalSet added = stream.Had().Minus(known.Get(key).Had());
    if (!added.is_empty()) news[key].held = std::move(added);
  }
  return news;
}

}  // namespace

PeerNotes::PeerNotes(proto::SharingKind kind, AgentId destination, std::uint64_t first_number)
    : kind_(kind), destination_(destination), number_(first_number) {}

void PeerNotes::NoteAnswer(const HaveSet& have, const std::set<AgentId>& origins, SharingActions& actions) {
  is_answered_ = true;
  origins_ = origins;
  NoteAllAgain(have, {}, actions);
}

void PeerNotes::NoteAcknowledged(const HaveSet& heard, const HaveSet& known, SharingActions& actions) {
  const HaveSet news = NewsOf(heard, known);
  if (news.streams().empty()) return;
  proto::PeerHave& note = NoteIn(actions);
  note.set_number(++number_);
  note.set_is_difference(true);
  *note.mutable_acknowledged() = ToProto(news);
}

void PeerNotes::NoteHandedOver(const std::vector<RecordKey>& keys, SharingActions& actions) const {
  if (keys.empty()) return;
  proto::PeerHave& note = NoteIn(actions);
  for (const RecordKey& key : keys) *note.add_handed_over() = ToProto(key);
}

void PeerNotes::NoteClosed(SharingActions& actions) const { NoteIn(actions).set_is_session_closed(true); }

void PeerNotes::NoteAllAgain(const HaveSet& have, const std::vector<RecordKey>& under_way, SharingActions& actions) {
  if (!is_answered_) return;
  proto::PeerHave& note = NoteIn(actions);
  note.set_number(++number_);
  *note.mutable_acknowledged() = ToProto(have);
  note.mutable_origin_agents()->Assign(origins_.begin(), origins_.end());
  NoteHandedOver(under_way, actions);
}

// The one of this step; the first to note something adds it.
proto::PeerHave& PeerNotes::NoteIn(SharingActions& actions) const {
  const auto note = std::find_if(actions.begin(), actions.end(),
                                 [](const SharingAction& action) { return action.message.has_peer_have(); });
  if (note != actions.end()) return *note->message.mutable_peer_have();
  SharingAction& added = actions.emplace_back();
  added.message.set_ms_type(proto::EVENT);
  added.message.mutable_peer_have()->set_peer(destination_);
  added.message.mutable_peer_have()->set_kind(kind_);
  return *added.message.mutable_peer_have();
}

}  // namespace moondb
