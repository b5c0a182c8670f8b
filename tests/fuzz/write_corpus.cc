// write_corpus FOLDER: generates the corpus of tests/fuzz in FOLDER, from random maps and records.
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>

#include "actors/sharing/codec.h"
#include "actors/sharing/coding/row_codec.h"
#include "actors/storage/paper_sql.h"
#include "model/check.h"
#include "model/control_message.h"
#include "model/record_check.h"
#include "model/record_hash.h"
#include "model/term.h"
#include "proto/control.pb.h"
#include "proto/message.pb.h"
#include "proto/types.pb.h"
#include "tests/actors/sharing/coding/records.h"
#include "tests/fuzz/decoders.h"
#include "tests/fuzz/peer_decoders.h"

namespace moondb {
namespace {

std::string Number(std::size_t value, int byte_count) {
  std::string bytes;
  for (int i = byte_count - 1; i >= 0; --i) bytes.push_back(static_cast<char>(value >> (8 * i)));
  return bytes;
}

proto::RecordBatch Rows() {
  proto::RecordBatch batch = RowBatch(20);
  *batch.add_records() = Store("no record at all", 1234, 9);
  return batch;
}

proto::RecordBatch Mixed() {
  proto::RecordBatch batch = Rows();
  batch.MergeFrom(MapBatch(0, 2));
  return batch;
}

bool Write(const std::filesystem::path& folder, const std::string& decoder, const std::string& name,
           const std::string& bytes) {
  std::error_code error;
  std::filesystem::create_directories(folder / decoder, error);
  std::ofstream file(folder / decoder / name, std::ios::binary);
  file << bytes;
  return static_cast<bool>(file.flush());
}

std::string CodedRun() {
  BatchEncoder encoder(MapRunEncoder::Previous::kWherePlaced);
  std::string bytes;
  for (int first = 0; first < 4; first += 2) {
    const std::string coded = encoder.Encode(MapBatch(first, 2));
    bytes += Number(2, 1) + Number(coded.size(), 2) + coded;
  }
  return bytes;
}

std::string CodedMaps(MapRunEncoder::Previous previous) {
  MapRunEncoder encoder(previous);
  for (int i = 0; i < 2; ++i) encoder.Add(RoomMap(7, 0.2 * i, 0, 0.3 * i, /*layer_count=*/2, /*cells=*/48));
  return Number(1, 1) + Number(2, 1) + Number(48, 1) + Number(48, 1) + encoder.Finish();
}

std::string CodedRows(const proto::RecordBatch& batch) {
  std::vector<std::string_view> contents;
  for (const proto::StoredRecord& record : batch.records()) contents.push_back(record.content());
  std::string bytes;
  PutRows(contents, bytes);
  return bytes;
}

bool WriteStatement(const std::filesystem::path& folder, const std::string& name, const proto::Record& record) {
  RecordKey key = kFuzzedSqlKey;
  key.stream.type = TypeOf(record);
  proto::StoredRecord stored;
  *stored.mutable_key() = ToProto(key);
  stored.set_content(record.SerializeAsString());
  stored.set_hash(HashRecord(key, stored.content()));
  const std::optional<std::string> sql = SqlOf(stored);
  Check(sql.has_value(), "the corpus is of records that have their statement");
  return Write(folder, "sql", name, Number(key.stream.type, 2) + *sql);
}

bool WriteStatements(const std::filesystem::path& folder) {
  std::mt19937_64 rng(1);
  proto::Record map, edge, custom;
  bool is_written = map.ParseFromString(MapOf(RoomMap(7, 0, 0, 0, /*layer_count=*/2, /*cells=*/8), 0).content());
  edge.mutable_pose_graph_edge()->mutable_relative_pose()->add_covariance(1e-300);
  custom.mutable_custom()->set_data_type(1007);
  custom.mutable_custom()->set_payload(std::string("\0'--", 4));
  custom.mutable_custom()->set_metadata("it's \"quoted\"; --");
  is_written = is_written && WriteStatement(folder, "temperature", TemperatureRecord(0)) &&
               WriteStatement(folder, "node", NodeRecord(3, rng)) && WriteStatement(folder, "edge", edge) &&
               WriteStatement(folder, "map", map) && WriteStatement(folder, "custom", custom);

  const std::string begin = "INSERT INTO temperature (record_id, agent_id, celsius) ";
  RecordKey key = kFuzzedSqlKey;
  key.stream.type = proto::TEMPERATURE;
  const std::string start = "('" + ToString(key) + "', 2, ";
  const auto with = [&](const std::string& value) { return begin + "VALUES " + start + value + ")"; };
  const std::string endless = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c) ";
  const std::pair<const char*, std::string> hostile[] = {
      {"attach", "ATTACH '/tmp/moondb_fuzz' AS other"},
      {"vacuum_into", "VACUUM INTO '/tmp/moondb_fuzz'"},
      {"pragma", "PRAGMA writable_schema = 1"},
      {"load_extension", with("load_extension('x')")},
      {"endless_select", endless + "SELECT count(*) FROM c"},
      {"endless_insert", begin + endless + "SELECT '" + ToString(key) + "', 2, x FROM c"},
      {"update", "UPDATE temperature SET celsius = 0"},
      {"delete", "DELETE FROM temperature"},
      {"replace", "INSERT OR REPLACE INTO temperature (record_id, agent_id, celsius) VALUES " + start + "1)"},
      {"upsert", with("1") + " ON CONFLICT DO UPDATE SET celsius = 2"},
      {"returning", with("1") + " RETURNING celsius"},
      {"two_statements", with("1") + "; " + with("2")},
      {"two_rows", with("1") + ", " + start + "2)"},
      {"trigger", "CREATE TRIGGER t AFTER INSERT ON temperature BEGIN SELECT 1; END"},
      {"schema", "INSERT INTO sqlite_master (name, tbl_name, rootpage) VALUES " + start + "1)"},
      {"zeroblob", with("zeroblob(1000000000)")},
      {"printf", with("printf('%1000000000d', 1)")},
      {"like", with("'" + std::string(200, 'a') + "' LIKE '" + std::string(60, '%') + "'")},
      {"deep", with(std::string(200, '(') + "1" + std::string(200, ')'))},
      {"odd_blob", with("X'ABC'")},
      {"open_blob", with("X'AB")},
      {"parameter", with("?")},
      {"comment", with("1") + " -- '"},
      {"other_quotes", with("\"'\"")},
      {"other_row", "INSERT INTO temperature (record_id, agent_id) VALUES ('" + ToString(key) + "', 3)"},
  };
  for (const auto& [name, sql] : hostile) {
    is_written = is_written && Write(folder, "sql", name, Number(proto::TEMPERATURE, 2) + sql);
  }
  return is_written;
}

bool WriteFrames(const std::filesystem::path& folder) {
  proto::PeerFrame peer;
  proto::Message& hello = *peer.add_messages();
  hello.set_hop_sender(3);
  hello.set_destination_actor("sync");
  hello.mutable_hello()->set_session_id(7);
  hello.mutable_hello()->set_team_id("00112233445566778899aabbccddeeff");
  proto::Message& have = *peer.add_messages();
  have.set_hop_sender(3);
  have.set_destination_actor("sync");
  proto::StreamHave& stream = *have.mutable_have()->mutable_have()->add_streams();
  stream.set_origin_agent(3);
  stream.set_epoch(9);
  stream.set_data_type(proto::POWER);
  stream.add_held()->set_first(1);
  stream.mutable_held(0)->set_last(4);
  proto::ControlRequest status, insert, roles;
  status.mutable_status();
  *insert.mutable_insert()->add_records() = TemperatureRecord(0);
  roles.mutable_role_set()->set_leader(2);
  roles.mutable_role_set()->set_survivor(1);
  return Write(folder, "peer_frame", "sharing", Number(1, 1) + peer.SerializeAsString()) &&
         Write(folder, "client_frame", "status", MessageOf(status).SerializeAsString()) &&
         Write(folder, "client_frame", "insert", MessageOf(insert).SerializeAsString()) &&
         Write(folder, "client_frame", "roles", MessageOf(roles).SerializeAsString());
}

// Writes FuzzedAssignment and FuzzedQuarantine, which have valid signatures. Also writes messages of an attacker: a
// role assignment of a high term, and the chain of assignments that allegedly precedes it.
bool WriteSigned(const std::filesystem::path& folder) {
  proto::RoleAnnounce announce;
  proto::RoleChainReply chain;
  std::string follows;
  for (std::uint64_t number = 1; number <= 3; ++number) {
    proto::RoleAssignment roles;
    roles.mutable_term()->set_number(TermNumber(0, number));
    roles.mutable_term()->set_issuer(3);
    roles.set_leader(3);
    roles.set_survivor(2);
    roles.set_follows(follows);
    roles.set_signature(follows = "signed " + std::to_string(number));
    *announce.mutable_roles() = roles;
    if (number < 3) chain.mutable_chain()->Add()->Swap(&roles);
  }
  std::reverse(chain.mutable_chain()->begin(), chain.mutable_chain()->end());
  const auto said = [](std::size_t kind, const std::string& bytes) {
    return Number(2, 1) + Number(kind, 1) + Number(bytes.size(), 2) + bytes;
  };
  return Write(folder, "signed", "assignment", FuzzedAssignment().SerializeAsString()) &&
         Write(folder, "signed", "quarantine", FuzzedQuarantine().SerializeAsString()) &&
         Write(folder, "chain", "announced",
               said(0, announce.SerializeAsString()) + said(1, chain.SerializeAsString())) &&
         Write(folder, "chain", "stored", said(3, announce.roles().SerializeAsString()));
}

bool WriteAll(const std::filesystem::path& folder) {
  const auto counted = [](const proto::RecordBatch& batch) {
    return Number(static_cast<std::size_t>(batch.records_size()), 2);
  };
  const auto compact = [](const proto::RecordBatch& batch) {
    return BatchEncoder(MapRunEncoder::Previous::kWhereItPays).Encode(batch);
  };
  const proto::StoredRecord reference = MapBatch(0, 1).records(0);
  BatchEncoder with_reference(MapRunEncoder::Previous::kWherePlaced);
  with_reference.BeginRun(&reference);
  const proto::RecordBatch rows = RowBatch(5), maps = MapBatch(0, 2);
  return Write(folder, "batch", "rows", counted(rows) + compact(rows)) &&
         Write(folder, "batch", "maps", counted(maps) + compact(maps)) &&
         Write(folder, "batch", "mixed", counted(Mixed()) + compact(Mixed())) &&
         Write(folder, "run", "maps", CodedRun()) &&
         Write(folder, "map", "alone", CodedMaps(MapRunEncoder::Previous::kNever)) &&
         Write(folder, "map", "previous", CodedMaps(MapRunEncoder::Previous::kWherePlaced)) &&
         Write(folder, "rows", "one_type", CodedRows(rows)) && Write(folder, "rows", "mixed", CodedRows(Rows())) &&
         Write(folder, "plain", "plain", Number(0, 1) + counted(rows) + rows.SerializeAsString()) &&
         Write(folder, "plain", "frame", Number(1, 1) + counted(Mixed()) + EncodeBatch(Mixed()).bytes) &&
         Write(folder, "reference", "head", with_reference.Encode(MapBatch(1, 1))) &&
         Write(folder, "reference", "map", MapOf(RoomMap(7, 0, 0, 0, 1, 24), 0).content()) && WriteStatements(folder) &&
         WriteFrames(folder) && WriteSigned(folder);
}

}  // namespace
}  // namespace moondb

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: write_corpus FOLDER\n");
    return 2;
  }
  return moondb::WriteAll(argv[1]) ? 0 : 1;
}
