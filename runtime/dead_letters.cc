#include "runtime/dead_letters.h"

#include <algorithm>
#include <utility>

#include "runtime/envelope.h"
#include "runtime/trace_book.h"

namespace moondb {
namespace {

// Returns `name` if it is printable ASCII, otherwise "?". A peer chooses its actors' names, which may hold any bytes.
std::string Printable(const std::string& name) {
  const bool is_text = std::all_of(name.begin(), name.end(), [](char c) { return c >= ' ' && c <= '~'; });
  return is_text ? name : "?";
}

}  // namespace

void DeadLetters::Add(MonotonicTime time, const std::string& actor, Mailbox::Item* item, Error error) {
  ++count_;
  Letter letter;
  letter.time = time;
  letter.actor = actor;
  letter.error = std::move(error);
  if (item != nullptr) {
    letter.sender = item->sender != nullptr ? *item->sender : SenderOf(*item->message);
    letter.body = static_cast<std::uint16_t>(item->message->body_case());
    letter.bytes = item->message->ByteSizeLong();
    if (letter.bytes <= kBytesMax) letter.message = std::move(item->message);
  }
  if (letter.message) bytes_ += letter.bytes;
  letters_.push_back(std::move(letter));
  while (letters_.size() > kLettersMax || bytes_ > kBytesMax) {
    if (letters_.front().message) bytes_ -= letters_.front().bytes;
    letters_.pop_front();
  }
}

void DeadLetters::Report(const proto::TraceRequest& request, MonotonicTime now, proto::TraceReply* reply) const {
  reply->set_dead_letter_count(static_cast<double>(count_));
  for (const Letter& letter : letters_) {
    if (!request.actor().empty() && letter.actor != request.actor()) continue;
    proto::DeadLetter& dead = *reply->add_dead_letters();
    dead.set_age_s(std::chrono::duration<double>(now - letter.time).count());
    dead.set_actor(letter.actor);
    dead.set_from_agent(letter.sender.agent);
    dead.set_from_actor(Printable(letter.sender.actor));
    dead.set_body(BodyName(letter.body));
    dead.set_bytes(static_cast<double>(letter.bytes));
    *dead.mutable_error() = ToProto(letter.error);
  }
}

}  // namespace moondb
