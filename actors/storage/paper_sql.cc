#include "actors/storage/paper_sql.h"

#include <sqlite3.h>

#include <cctype>
#include <charconv>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "model/grid.h"
#include "model/record_hash.h"
#include "proto/types.pb.h"

namespace moondb {

namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

// Limits on the columns of a table.
constexpr int kNumbersMax = 36;   // Values of one repeated field, such as a covariance.
constexpr int kMessagesMax = 16;  // Messages of one repeated field, such as the layers of a map.
constexpr int kDepthMax = 5;
constexpr std::size_t kColumnsMax = 1500;
// Maximum number of steps of SQLite's virtual machine. An insert of kColumnsMax values needs fewer steps.
constexpr int kStepsMax = 20'000;

constexpr char kNoInsert[] = "is not an insert into the table of its type";

struct PathStep {
  const FieldDescriptor* field = nullptr;
  int index = -1;  // Index in a repeated field; -1 if the field is not repeated.
};

struct Column {
  std::string name;
  std::vector<PathStep> path;  // Path from the Record to the field.
};

struct PaperTable {
  std::string name;
  std::vector<Column> columns;
};

Error Corrupt(const char* text) { return Error{ErrorCode::kCorrupt, text, "sql"}; }

const FieldDescriptor* BodyOf(DataType type) {
  if (IsCustom(type)) return proto::Record::descriptor()->FindFieldByNumber(proto::Record::kCustomFieldNumber);
  const auto* body = proto::Record::descriptor()->FindOneofByName("body");
  const auto* value = proto::DataType_descriptor()->FindValueByNumber(static_cast<int>(type));
  for (int i = 0; value != nullptr && i < body->field_count(); ++i) {
    std::string name = body->field(i)->name();
    for (char& letter : name) letter = static_cast<char>(std::toupper(static_cast<unsigned char>(letter)));
    if (name == value->name()) return body->field(i);
  }
  return nullptr;
}

bool IsOfEveryTable(const std::string& name) {
  return name == "record_id" || name == "agent_id" || name == "timestamp_ns" || name == "is_clock_suspect" ||
         name == "is_state";
}

void AddColumns(const std::string& prefix, std::vector<PathStep> path, std::vector<Column>& columns) {
  const FieldDescriptor& field = *path.back().field;
  columns.push_back({prefix, path});
  if (field.cpp_type() != FieldDescriptor::CPPTYPE_MESSAGE || path.size() > kDepthMax) return;
  for (int i = 0; i < field.message_type()->field_count() && columns.size() <= kColumnsMax; ++i) {
    const FieldDescriptor& inner = *field.message_type()->field(i);
    const bool is_message = inner.cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
    const bool is_short = path.size() == 1 && !IsOfEveryTable(inner.name());
    const std::string name = is_short ? inner.name() : prefix + "_" + inner.name();
    path.push_back({&inner, -1});
    if (!inner.is_repeated()) AddColumns(name, path, columns);
    for (int index = 0; inner.is_repeated() && index < (is_message ? kMessagesMax : kNumbersMax); ++index) {
      path.back().index = index;
      AddColumns(name + "_" + std::to_string(index), path, columns);
    }
    path.pop_back();
  }
}

// Returns the table for a data type. Null if the type is unknown here or would need too many columns.
std::optional<PaperTable> TableOf(DataType type) {
  const FieldDescriptor* body = BodyOf(type);
  if (body == nullptr) return std::nullopt;
  PaperTable table{body->name(), {}};
  for (const char* name : {"timestamp_ns", "is_clock_suspect", "is_state"}) {
    table.columns.push_back({name, {{proto::Record::descriptor()->FindFieldByName(name), -1}}});
  }
  AddColumns("body", {{body, -1}}, table.columns);
  std::set<std::string> names = {"record_id", "agent_id"};
  for (const Column& column : table.columns) {
    if (!names.insert(column.name).second) return std::nullopt;
  }
  if (table.columns.size() > kColumnsMax) return std::nullopt;
  return table;
}

std::string Hex(std::string_view bytes) {
  constexpr char kDigits[] = "0123456789ABCDEF";
  std::string text = "X'";
  for (const char byte : bytes) {
    text += kDigits[static_cast<unsigned char>(byte) >> 4];
    text += kDigits[static_cast<unsigned char>(byte) & 15];
  }
  return text + "'";
}

std::string Quoted(const std::string& text) {
  std::string quoted = "'";
  for (const char letter : text) quoted += letter == '\'' ? std::string("''") : std::string(1, letter);
  return quoted + "'";
}

// With few digits, SQLite converts about one literal in some thousand to a neighbouring number. With kMany, it converts
// every literal exactly.
enum class Digits { kFew, kMany };

std::string Real(double value, Digits digits) {
  constexpr int kManyDigits = 17;
  char text[40];
  const auto end = digits == Digits::kFew
                       ? std::to_chars(text, text + sizeof text, value).ptr
                       : std::to_chars(text, text + sizeof text, value, std::chars_format::general, kManyDigits).ptr;
  std::string literal(text, end);
  // Without a decimal point SQLite would read the literal as an integer.
  return literal.find_first_of(".en") == std::string::npos ? literal + ".0" : literal;
}

std::string Integer(std::int64_t value) { return std::to_string(value); }

// Returns the SQL literal of one value. `step` selects the field, and the index in a repeated field.
std::string LiteralOf(const Message& message, const PathStep& step, Digits digits) {
  const Reflection& all = *message.GetReflection();
  const FieldDescriptor* field = step.field;
  const int i = step.index;
  switch (field->cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE:
      return Real(i < 0 ? all.GetDouble(message, field) : all.GetRepeatedDouble(message, field, i), digits);
    case FieldDescriptor::CPPTYPE_FLOAT:
      return Real(i < 0 ? all.GetFloat(message, field) : all.GetRepeatedFloat(message, field, i), digits);
    case FieldDescriptor::CPPTYPE_INT32:
      return Integer(i < 0 ? all.GetInt32(message, field) : all.GetRepeatedInt32(message, field, i));
    case FieldDescriptor::CPPTYPE_INT64:
      return Integer(i < 0 ? all.GetInt64(message, field) : all.GetRepeatedInt64(message, field, i));
    case FieldDescriptor::CPPTYPE_UINT32:
      return Integer(i < 0 ? all.GetUInt32(message, field) : all.GetRepeatedUInt32(message, field, i));
    case FieldDescriptor::CPPTYPE_UINT64:
      return Integer(
          static_cast<std::int64_t>(i < 0 ? all.GetUInt64(message, field) : all.GetRepeatedUInt64(message, field, i)));
    case FieldDescriptor::CPPTYPE_BOOL:
      return Integer((i < 0 ? all.GetBool(message, field) : all.GetRepeatedBool(message, field, i)) ? 1 : 0);
    case FieldDescriptor::CPPTYPE_ENUM:
      return Integer(i < 0 ? all.GetEnumValue(message, field) : all.GetRepeatedEnumValue(message, field, i));
    case FieldDescriptor::CPPTYPE_STRING: {
      const std::string text = i < 0 ? all.GetString(message, field) : all.GetRepeatedString(message, field, i);
      return field->type() == FieldDescriptor::TYPE_BYTES ? Hex(text) : Quoted(text);
    }
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return "1";
  }
  return "NULL";
}

bool IsThere(const Message& message, const PathStep& step) {
  const Reflection& all = *message.GetReflection();
  return step.index < 0 ? all.HasField(message, step.field) : step.index < all.FieldSize(message, step.field);
}

const Message& Within(const Message& message, const PathStep& step) {
  const Reflection& all = *message.GetReflection();
  return step.index < 0 ? all.GetMessage(message, step.field) : all.GetRepeatedMessage(message, step.field, step.index);
}

bool HasAnyField(const Message& message) {
  std::vector<const FieldDescriptor*> fields;
  message.GetReflection()->ListFields(message, &fields);
  return !fields.empty();
}

// Returns the SQL value of a column; null if the record has no value for it.
std::optional<std::string> ValueOf(const proto::Record& record, const Column& column, Digits digits) {
  const Message* message = &record;
  for (std::size_t i = 0; i + 1 < column.path.size(); ++i) {
    if (!IsThere(*message, column.path[i])) return std::nullopt;
    message = &Within(*message, column.path[i]);
  }
  const PathStep& last = column.path.back();
  if (!IsThere(*message, last)) return std::nullopt;
  const bool is_message = last.field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
  if (is_message && HasAnyField(Within(*message, last))) return std::nullopt;
  return LiteralOf(*message, last, digits);
}

// Sets one field of a message to the value in column `number` of the current row.
void SetValue(sqlite3_stmt* row, int number, const PathStep& step, Message& message) {
  const Reflection& all = *message.GetReflection();
  const FieldDescriptor* field = step.field;
  const bool is_one = step.index < 0;
  const std::int64_t integer = sqlite3_column_int64(row, number);
  switch (field->cpp_type()) {
    case FieldDescriptor::CPPTYPE_DOUBLE: {
      const double value = sqlite3_column_double(row, number);
      return is_one ? all.SetDouble(&message, field, value) : all.AddDouble(&message, field, value);
    }
    case FieldDescriptor::CPPTYPE_FLOAT: {
      const float value = static_cast<float>(sqlite3_column_double(row, number));
      return is_one ? all.SetFloat(&message, field, value) : all.AddFloat(&message, field, value);
    }
    case FieldDescriptor::CPPTYPE_INT32: {
      const auto value = static_cast<std::int32_t>(integer);
      return is_one ? all.SetInt32(&message, field, value) : all.AddInt32(&message, field, value);
    }
    case FieldDescriptor::CPPTYPE_INT64:
      return is_one ? all.SetInt64(&message, field, integer) : all.AddInt64(&message, field, integer);
    case FieldDescriptor::CPPTYPE_UINT32: {
      const auto value = static_cast<std::uint32_t>(integer);
      return is_one ? all.SetUInt32(&message, field, value) : all.AddUInt32(&message, field, value);
    }
    case FieldDescriptor::CPPTYPE_UINT64: {
      const auto value = static_cast<std::uint64_t>(integer);
      return is_one ? all.SetUInt64(&message, field, value) : all.AddUInt64(&message, field, value);
    }
    case FieldDescriptor::CPPTYPE_BOOL:
      return is_one ? all.SetBool(&message, field, integer != 0) : all.AddBool(&message, field, integer != 0);
    case FieldDescriptor::CPPTYPE_ENUM: {
      const auto value = static_cast<int>(integer);
      return is_one ? all.SetEnumValue(&message, field, value) : all.AddEnumValue(&message, field, value);
    }
    case FieldDescriptor::CPPTYPE_STRING: {
      const void* bytes = sqlite3_column_blob(row, number);
      const auto size = static_cast<std::size_t>(sqlite3_column_bytes(row, number));
      std::string value(static_cast<const char*>(bytes), bytes == nullptr ? 0 : size);
      return is_one ? all.SetString(&message, field, std::move(value))
                    : all.AddString(&message, field, std::move(value));
    }
    case FieldDescriptor::CPPTYPE_MESSAGE:
      is_one ? (void)all.MutableMessage(&message, field) : (void)all.AddMessage(&message, field);
  }
}

// Sets one field of the record to the value in column `number` of the current row. Returns false if the column belongs
// to a repeated field whose earlier values are missing.
bool Take(sqlite3_stmt* row, int number, const Column& column, proto::Record& record) {
  Message* message = &record;
  for (std::size_t i = 0; i + 1 < column.path.size(); ++i) {
    const PathStep& step = column.path[i];
    const Reflection& all = *message->GetReflection();
    if (step.index < 0) {
      message = all.MutableMessage(message, step.field);
      continue;
    }
    const int size = all.FieldSize(*message, step.field);
    if (step.index > size) return false;
    message = step.index == size ? all.AddMessage(message, step.field)
                                 : all.MutableRepeatedMessage(message, step.field, step.index);
  }
  const PathStep& last = column.path.back();
  if (last.index >= 0 && last.index != message->GetReflection()->FieldSize(*message, last.field)) return false;
  SetValue(row, number, last, *message);
  return true;
}

// Converts a map's cells from the record's packed form, four cells per byte, to one byte each.
bool SpreadCells(proto::Record& record) {
  if (!record.has_local_traversability_map()) return true;
  for (proto::MapLayer& layer : *record.mutable_local_traversability_map()->mutable_layers()) {
    const auto width = static_cast<std::int32_t>(layer.width_cells());
    const auto height = static_cast<std::int32_t>(layer.height_cells());
    const Result<Grid> grid = UnpackCells(width, height, layer.cells());
    if (!grid) return false;
    std::string cells;
    for (const Cell cell : grid->cells) cells.push_back(static_cast<char>(cell));
    layer.set_cells(std::move(cells));
  }
  return true;
}

bool GatherCells(proto::Record& record) {
  if (!record.has_local_traversability_map()) return true;
  for (proto::MapLayer& layer : *record.mutable_local_traversability_map()->mutable_layers()) {
    const std::uint64_t count = std::uint64_t{layer.width_cells()} * layer.height_cells();
    if (count != layer.cells().size() || layer.width_cells() == 0) return false;
    Grid grid(static_cast<std::int32_t>(layer.width_cells()), static_cast<std::int32_t>(layer.height_cells()));
    for (std::size_t i = 0; i < grid.cells.size(); ++i) {
      if (static_cast<unsigned char>(layer.cells()[i]) > static_cast<unsigned char>(Cell::kHazard)) return false;
      grid.cells[i] = static_cast<Cell>(layer.cells()[i]);
    }
    layer.set_cells(PackCells(grid));
  }
  return true;
}

struct CloseSql {
  void operator()(sqlite3* database) const { sqlite3_close(database); }
  void operator()(sqlite3_stmt* statement) const { sqlite3_finalize(statement); }
};
using DatabaseHandle = std::unique_ptr<sqlite3, CloseSql>;
using SqlStatement = std::unique_ptr<sqlite3_stmt, CloseSql>;

// SQLite's authorizer: permits inserts into `table`, and denies everything else.
int Authorize(void* table, int action, const char* name, const char*, const char* database, const char* trigger) {
  const bool is_insert = action == SQLITE_INSERT && name != nullptr && *static_cast<std::string*>(table) == name &&
                         database != nullptr && std::string_view(database) == "main" && trigger == nullptr;
  return is_insert ? SQLITE_OK : SQLITE_DENY;
}

int Stop(void*) { return 1; }

// Opens an in-memory database that contains only `table`, without rows.
DatabaseHandle OpenFor(const PaperTable& table) {
  sqlite3* opened = nullptr;
  const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_MEMORY | SQLITE_OPEN_NOMUTEX;
  const int result = sqlite3_open_v2(":memory:", &opened, flags, nullptr);
  DatabaseHandle database(opened);
  if (result != SQLITE_OK) return nullptr;
  std::string create = "CREATE TABLE \"" + table.name + "\" (record_id, agent_id";
  for (const Column& column : table.columns) create += ", \"" + column.name + "\"";
  if (sqlite3_exec(opened, (create + ")").c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) return nullptr;
  for (const int option : {SQLITE_DBCONFIG_ENABLE_TRIGGER, SQLITE_DBCONFIG_ENABLE_VIEW, SQLITE_DBCONFIG_DQS_DML,
                           SQLITE_DBCONFIG_DQS_DDL, SQLITE_DBCONFIG_TRUSTED_SCHEMA}) {
    sqlite3_db_config(opened, option, 0, nullptr);
  }
  sqlite3_db_config(opened, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  constexpr std::pair<int, int> kLimits[] = {{SQLITE_LIMIT_LENGTH, static_cast<int>(kPaperSqlBytesMax)},
                                             {SQLITE_LIMIT_SQL_LENGTH, static_cast<int>(kPaperSqlBytesMax)},
                                             {SQLITE_LIMIT_COLUMN, static_cast<int>(kColumnsMax) + 2},
                                             {SQLITE_LIMIT_EXPR_DEPTH, 4},
                                             {SQLITE_LIMIT_COMPOUND_SELECT, 1},
                                             {SQLITE_LIMIT_VDBE_OP, kStepsMax},
                                             {SQLITE_LIMIT_FUNCTION_ARG, 0},
                                             {SQLITE_LIMIT_ATTACHED, 0},
                                             {SQLITE_LIMIT_VARIABLE_NUMBER, 0},
                                             {SQLITE_LIMIT_TRIGGER_DEPTH, 0},
                                             {SQLITE_LIMIT_WORKER_THREADS, 0}};
  for (const auto& [limit, value] : kLimits) sqlite3_limit(opened, limit, value);
  return database;
}

// Returns true if the text outside of quoted values is not too long and has only letters, digits and kSigns, without
// comments. No text that SqlOf writes outside of quoted values for `table` is too long. Other syntax could hide quotes.
// The length is limited because SQLite needs a hundred times the size of such text in memory, and searches all columns
// for each name in it.
bool IsShortOutsideQuotes(std::string_view sql, const PaperTable& table) {
  constexpr std::size_t kNumberBytesMax = 32;  // Maximum bytes of a number and its separator.
  constexpr std::size_t kOtherBytesMax = 160;
  constexpr std::string_view kSigns = "_ ,.()+-";
  std::size_t left = kOtherBytesMax + table.name.size();
  for (const Column& column : table.columns) left += column.name.size() + kNumberBytesMax;
  bool is_quoted = false;
  char before = 0;
  for (const char letter : sql) {
    if (letter == '\'') {
      is_quoted = !is_quoted;
    } else if (!is_quoted) {
      const bool is_known = std::isalnum(static_cast<unsigned char>(letter)) || kSigns.find(letter) != kSigns.npos;
      const bool is_comment = letter == '-' && before == '-';
      if (!is_known || is_comment || left-- == 0) return false;
    }
    before = letter;
  }
  return true;
}

Result<void> Run(std::string_view sql, PaperTable& table, sqlite3* database) {
  sqlite3_set_authorizer(database, Authorize, &table.name);
  sqlite3_progress_handler(database, kStepsMax, Stop, nullptr);
  sqlite3_stmt* prepared = nullptr;
  const char* tail = nullptr;
  const int result = sqlite3_prepare_v2(database, sql.data(), static_cast<int>(sql.size()), &prepared, &tail);
  const SqlStatement statement(prepared);
  if (result != SQLITE_OK || !statement) return tl::unexpected(Corrupt(kNoInsert));
  if (tail != sql.data() + sql.size()) return tl::unexpected(Corrupt("has text after its statement"));
  if (sqlite3_step(prepared) != SQLITE_DONE) return tl::unexpected(Corrupt("cannot be executed"));
  if (sqlite3_changes(database) != 1) return tl::unexpected(Corrupt("does not insert exactly one row"));
  sqlite3_set_authorizer(database, nullptr, nullptr);
  sqlite3_progress_handler(database, 0, nullptr, nullptr);
  return {};
}

bool IsText(sqlite3_stmt* row, int number, const std::string& text) {
  if (sqlite3_column_type(row, number) != SQLITE_TEXT) return false;
  const auto* bytes = reinterpret_cast<const char*>(sqlite3_column_text(row, number));
  return std::string_view(bytes, static_cast<std::size_t>(sqlite3_column_bytes(row, number))) == text;
}

Result<proto::Record> ReadRow(const PaperTable& table, const RecordKey& key, sqlite3* database) {
  sqlite3_stmt* prepared = nullptr;
  const std::string select = "SELECT * FROM \"" + table.name + "\"";
  const int result = sqlite3_prepare_v2(database, select.c_str(), -1, &prepared, nullptr);
  const SqlStatement row(prepared);
  if (result != SQLITE_OK || sqlite3_step(prepared) != SQLITE_ROW) return tl::unexpected(Corrupt("inserts no row"));
  const bool is_announced = IsText(prepared, 0, ToString(key)) && sqlite3_column_type(prepared, 1) == SQLITE_INTEGER &&
                            sqlite3_column_int64(prepared, 1) == std::int64_t{key.stream.origin};
  if (!is_announced) return tl::unexpected(Corrupt("inserts a row whose key differs from the key of its message"));
  proto::Record record;
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const int number = static_cast<int>(i) + 2;
    if (sqlite3_column_type(prepared, number) == SQLITE_NULL) continue;
    if (!Take(prepared, number, table.columns[i], record)) return tl::unexpected(Corrupt("lacks a value of the row"));
  }
  if (sqlite3_step(prepared) != SQLITE_DONE) return tl::unexpected(Corrupt("inserts more than one row"));
  return record;
}

std::string StatementOf(const proto::Record& record, const RecordKey& key, const PaperTable& table, Digits digits) {
  std::string names = "record_id, agent_id";
  std::string values = "'" + ToString(key) + "', " + std::to_string(key.stream.origin);
  for (const Column& column : table.columns) {
    const std::optional<std::string> value = ValueOf(record, column, digits);
    if (!value) continue;
    names += ", " + column.name;
    values += ", " + *value;
  }
  return "INSERT INTO " + table.name + " (" + names + ") VALUES (" + values + ")";
}

}  // namespace

std::optional<std::string> SqlOf(const proto::StoredRecord& stored) {
  const RecordKey key = FromProto(stored.key());
  const std::optional<PaperTable> table = TableOf(key.stream.type);
  proto::Record record;
  if (!table || !record.ParseFromString(stored.content()) || !SpreadCells(record)) return std::nullopt;
  for (const Digits digits : {Digits::kFew, Digits::kMany}) {
    std::string sql = StatementOf(record, key, *table, digits);
    const Result<proto::StoredRecord> back = RecordOf(sql, key);
    if (back && back->content() == stored.content() && back->hash() == stored.hash()) return sql;
  }
  return std::nullopt;
}

Result<proto::StoredRecord> RecordOf(std::string_view sql, const RecordKey& key) {
  if (sql.size() > kPaperSqlBytesMax) return tl::unexpected(Corrupt("is longer than 8 MiB"));
  std::optional<PaperTable> table = TableOf(key.stream.type);
  if (!table) return tl::unexpected(Corrupt("is of a type that has no table"));
  if (!IsShortOutsideQuotes(sql, *table)) return tl::unexpected(Corrupt(kNoInsert));
  const DatabaseHandle database = OpenFor(*table);
  if (!database) return Fail(ErrorCode::kInternal, "a database in memory cannot be created", "sql");
  if (const Result<void> run = Run(sql, *table, database.get()); !run) return tl::unexpected(run.error());
  Result<proto::Record> record = ReadRow(*table, key, database.get());
  if (!record) return tl::unexpected(record.error());
  if (!GatherCells(*record)) return tl::unexpected(Corrupt("has invalid map cells"));
  proto::StoredRecord stored;
  *stored.mutable_key() = ToProto(key);
  stored.set_content(record->SerializeAsString());
  stored.set_hash(HashRecord(key, stored.content()));
  return stored;
}

}  // namespace moondb
