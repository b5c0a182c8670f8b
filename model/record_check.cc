#include "model/record_check.h"

#include <google/protobuf/descriptor.h>

#include <map>

#include "model/data_types.h"
#include "model/field_checker.h"
#include "proto/types.pb.h"

namespace moondb {

namespace {

// Returns the rows of DataTypeRows(), keyed by the field number of their data type in proto::Record.
std::map<int, const DataTypeRow*> RowsByBody() {
  std::map<int, const DataTypeRow*> rows;
  for (const DataTypeRow& row : DataTypeRows()) {
    const auto* field = proto::Record::descriptor()->FindFieldByName(DataTypeName(row.type));
    if (field != nullptr) rows[field->number()] = &row;
  }
  return rows;
}

// Returns the row of the record's type. Null for a custom record, a record without a body, and a type without a row.
const DataTypeRow* RowOf(const proto::Record& record) {
  static const std::map<int, const DataTypeRow*> kRows = RowsByBody();
  const auto row = kRows.find(record.body_case());
  return row == kRows.end() ? nullptr : row->second;
}

void CheckCustom(const proto::CustomRecord& custom, FieldChecker& check) {
  check.Require(IsCustom(custom.data_type()), "custom.data_type",
                "must be " + std::to_string(kCustomDataTypeMin) + " to " + std::to_string(kCustomDataTypeMax));
  check.Size(custom.latest_key(), kCustomKeyBytesMax, "custom.latest_key");
  check.Size(custom.payload(), kCustomPayloadBytesMax, "custom.payload");
  check.Text(custom.metadata(), kCustomMetadataBytesMax, "custom.metadata");
}

}  // namespace

DataType TypeOf(const proto::Record& record) {
  if (record.has_custom() && IsCustom(record.custom().data_type())) return record.custom().data_type();
  const DataTypeRow* row = RowOf(record);
  return row == nullptr ? DataType{proto::DATA_TYPE_UNSPECIFIED} : row->type;
}

Result<void> CheckRecord(const proto::Record& record) {
  FieldChecker check;
  if (record.has_custom()) {
    CheckCustom(record.custom(), check);
  } else if (const DataTypeRow* row = RowOf(record)) {
    row->check(record, check);
  } else {
    check.Require(false, "body", "is missing or of an unknown type");
  }
  return check.Take();
}

std::vector<NamedAgent> AgentsNamedIn(const proto::Record& record) {
  const DataTypeRow* row = RowOf(record);
  return row == nullptr || row->agents == nullptr ? std::vector<NamedAgent>() : row->agents(record);
}

std::string LatestKey(const proto::Record& record) {
  if (record.has_custom()) return record.custom().latest_key();
  const DataTypeRow* row = RowOf(record);
  return row == nullptr || row->latest_key == nullptr ? "" : row->latest_key(record);
}

std::string NaturalKey(const proto::Record& record) {
  const DataTypeRow* row = RowOf(record);
  return row == nullptr || row->natural_key == nullptr ? "" : row->natural_key(record);
}

}  // namespace moondb
