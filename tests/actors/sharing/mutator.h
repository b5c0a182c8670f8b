// Mutator: mutates valid input and invents invalid input, to test the checks on peers' messages.
#pragma once

#include <google/protobuf/descriptor.h>
#include <google/protobuf/message.h>

#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace moondb {

class Mutator {
 public:
  explicit Mutator(std::uint64_t seed) : rng_(seed) {}

  std::uint64_t Draw(std::uint64_t count) { return rng_() % count; }

  // Changes, drops, repeats or swaps one to four fields anywhere in the message.
  void Mutate(google::protobuf::Message& message) {
    for (std::uint64_t left = 1 + Draw(4); left > 0; --left) MutateOnce(message);
  }

  // Changes, removes, repeats or flips bytes at one to six places.
  void Mutate(std::string& bytes) {
    for (std::uint64_t left = 1 + Draw(6); left > 0 && !bytes.empty(); --left) {
      const std::size_t at = Draw(bytes.size());
      switch (Draw(4)) {
        case 0:
          bytes[at] = static_cast<char>(rng_());
          break;
        case 1:
          bytes.erase(at, 1 + Draw(8));
          break;
        case 2:
          bytes.insert(at, bytes.substr(at, Draw(32)));
          break;
        default:
          bytes[at] = static_cast<char>(bytes[at] ^ (1 << Draw(8)));
      }
    }
  }

  std::string Bytes(std::size_t size_max) {
    std::string bytes(Draw(size_max + 1), '\0');
    for (char& byte : bytes) byte = static_cast<char>(rng_());
    return bytes;
  }

  // Returns a small number, a boundary value or any number.
  std::uint64_t Number() {
    constexpr std::uint64_t kEdges[] = {0,     1,         2,          3,         4095,           4096,
                                        65536, INT32_MAX, UINT32_MAX, INT64_MAX, UINT64_MAX - 1, UINT64_MAX};
    switch (Draw(3)) {
      case 0:
        return Draw(20);
      case 1:
        return rng_();
      default:
        return kEdges[Draw(std::size(kEdges))];
    }
  }

 private:
  using Field = google::protobuf::FieldDescriptor;

  void MutateOnce(google::protobuf::Message& message) {
    const auto& descriptor = *message.GetDescriptor();
    if (descriptor.field_count() == 0) return;
    // Usually chooses a field that is set, and sometimes any field of the message.
    std::vector<const Field*> fields;
    message.GetReflection()->ListFields(message, &fields);
    const bool is_any = fields.empty() || Draw(4) == 0;
    const Field& field =
        is_any ? *descriptor.field(static_cast<int>(Draw(static_cast<std::uint64_t>(descriptor.field_count()))))
               : *fields[Draw(fields.size())];
    if (field.is_repeated()) {
      MutateList(message, field);
    } else if (Draw(8) == 0) {
      message.GetReflection()->ClearField(&message, &field);
    } else if (field.cpp_type() == Field::CPPTYPE_MESSAGE) {
      MutateOnce(*message.GetReflection()->MutableMessage(&message, &field));
    } else {
      SetScalar(message, field);
    }
  }

  void MutateList(google::protobuf::Message& message, const Field& field) {
    const auto& reflection = *message.GetReflection();
    const int size = reflection.FieldSize(message, &field);
    const int at = size == 0 ? 0 : static_cast<int>(Draw(static_cast<std::uint64_t>(size)));
    const bool is_message = field.cpp_type() == Field::CPPTYPE_MESSAGE;
    switch (size == 0 ? 3 : Draw(5)) {
      case 0:
        return reflection.RemoveLast(&message, &field);
      case 1:
        return reflection.SwapElements(&message, &field, at, static_cast<int>(Draw(static_cast<std::uint64_t>(size))));
      case 2:
        if (!is_message) return;
        // Repeats the entry, sometimes thousands of times.
        for (std::uint64_t left = Draw(3) == 0 ? Draw(5000) : 1; left > 0; --left) {
          auto& added = *reflection.AddMessage(&message, &field);
          added.CopyFrom(reflection.GetRepeatedMessage(message, &field, at));
        }
        return;
      case 3:
        if (is_message) {
          MutateOnce(*reflection.AddMessage(&message, &field));
        } else if (field.cpp_type() == Field::CPPTYPE_UINT32) {
          reflection.AddUInt32(&message, &field, static_cast<std::uint32_t>(Number()));
        }
        return;
      default:
        if (is_message) MutateOnce(*reflection.MutableRepeatedMessage(&message, &field, at));
    }
  }

  void SetScalar(google::protobuf::Message& message, const Field& field) {
    const auto& reflection = *message.GetReflection();
    switch (field.cpp_type()) {
      case Field::CPPTYPE_UINT32:
        return reflection.SetUInt32(&message, &field, static_cast<std::uint32_t>(Number()));
      case Field::CPPTYPE_UINT64:
        return reflection.SetUInt64(&message, &field, Number());
      case Field::CPPTYPE_INT64:
        return reflection.SetInt64(&message, &field, static_cast<std::int64_t>(Number()));
      case Field::CPPTYPE_BOOL:
        return reflection.SetBool(&message, &field, Draw(2) == 0);
      case Field::CPPTYPE_ENUM:
        return reflection.SetEnumValue(&message, &field, static_cast<int>(Draw(12)));
      case Field::CPPTYPE_DOUBLE:
        return reflection.SetDouble(&message, &field, static_cast<double>(Number()));
      case Field::CPPTYPE_STRING: {
        if (field.type() == Field::TYPE_STRING) return reflection.SetString(&message, &field, "text");
        std::string bytes = reflection.GetString(message, &field);
        Mutate(bytes);
        return reflection.SetString(&message, &field, Draw(4) == 0 ? Bytes(Draw(4) == 0 ? 5000 : 100) : bytes);
      }
      default:
        return;
    }
  }

  std::mt19937_64 rng_;
};

}  // namespace moondb
