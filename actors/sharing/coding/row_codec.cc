#include "actors/sharing/coding/row_codec.h"

#include <algorithm>

#include "actors/sharing/coding/number_column.h"
#include "actors/sharing/coding/row_shape.h"
#include "model/check.h"
#include "proto/record.pb.h"

namespace moondb {

namespace {

// The rows of one shape, column by column.
struct Table {
  RowShape shape;
  ValueCount counts;
  std::size_t row_count = 0;
  std::vector<std::vector<std::uint64_t>> numbers;   // One vector per column of numbers.
  std::vector<std::vector<std::string_view>> texts;  // One vector per column of texts.
};

Table MakeTable(RowShape shape) {
  Table table;
  table.counts = CountValues(shape);
  table.shape = std::move(shape);
  table.numbers.resize(table.counts.numbers);
  table.texts.resize(table.counts.texts);
  return table;
}

class RowEncoder {
 public:
  void Add(std::string_view row) {
    const std::size_t table = TableFor(row);
    Append(tables_[table]);
    table_of_row_.push_back(table);
    last_table_ = table;
  }

  void Put(std::string& bytes) const {
    PutVarint(table_of_row_.size(), bytes);
    PutVarint(tables_.size(), bytes);
    for (const Table& table : tables_) PutShape(table.shape, bytes);
    if (tables_.size() > 1) PutColumn(table_of_row_, bytes);
    for (const Table& table : tables_) PutTable(table, bytes);
  }

 private:
  // Returns the index of the table for the row's shape, and stores the row's values in values_.
  std::size_t TableFor(std::string_view row) {
    if (!tables_.empty() && ReadRow(row, tables_[last_table_].shape, values_)) return last_table_;
    RowShape shape = FindShape(row, *proto::Record::descriptor());
    std::size_t table = FindTable(shape);
    if (table == tables_.size() && table + 1 >= kRowShapesMax) {
      shape = {ShapePart{}};
      table = FindTable(shape);
    }
    if (table == tables_.size()) tables_.push_back(MakeTable(shape));
    Check(ReadRow(row, shape, values_), "a row is of its own shape");
    return table;
  }

  std::size_t FindTable(const RowShape& shape) const {
    const auto found =
        std::find_if(tables_.begin(), tables_.end(), [&](const Table& table) { return table.shape == shape; });
    return static_cast<std::size_t>(found - tables_.begin());
  }

  void Append(Table& table) const {
    for (std::size_t i = 0; i < values_.numbers.size(); ++i) table.numbers[i].push_back(values_.numbers[i]);
    for (std::size_t i = 0; i < values_.texts.size(); ++i) table.texts[i].push_back(values_.texts[i]);
  }

  static void PutTable(const Table& table, std::string& bytes) {
    for (const auto& column : table.numbers) PutColumn(column, bytes);
    for (const auto& column : table.texts) {
      std::vector<std::uint64_t> sizes;
      for (const std::string_view text : column) sizes.push_back(text.size());
      PutColumn(sizes, bytes);
      for (const std::string_view text : column) bytes += text;
    }
  }

  std::vector<Table> tables_;
  std::vector<std::uint64_t> table_of_row_;
  std::size_t last_table_ = 0;
  RowValues values_;
};

class RowDecoder {
 public:
  RowDecoder(std::size_t content_bytes_max, ByteReader& reader) : bytes_left_(content_bytes_max), reader_(reader) {}

  std::vector<std::string> Take() {
    const std::uint64_t row_count = reader_.Varint();
    const std::uint64_t table_count = reader_.Varint();
    if (row_count > kRowsMax || table_count > kRowShapesMax || (table_count == 0) != (row_count == 0)) reader_.Fail();
    for (std::uint64_t i = 0; i < table_count && reader_.is_good(); ++i)
      tables_.push_back(MakeTable(TakeShape(reader_)));
    if (!reader_.is_good() || row_count == 0) return {};
    table_of_row_.assign(row_count, 0);
    if (table_count > 1) table_of_row_ = TakeColumn(row_count, reader_);
    CountRows();
    for (Table& table : tables_) TakeTable(table);
    return MakeRows();
  }

 private:
  void CountRows() {
    for (const std::uint64_t table : table_of_row_) {
      if (table >= tables_.size()) return reader_.Fail();
      ++tables_[table].row_count;
    }
  }

  void TakeTable(Table& table) {
    for (auto& column : table.numbers) {
      if (reader_.is_good()) column = TakeColumn(table.row_count, reader_);
    }
    for (auto& column : table.texts) {
      if (!reader_.is_good()) return;
      for (const std::uint64_t size : TakeColumn(table.row_count, reader_)) column.push_back(reader_.Bytes(size));
    }
  }

  std::vector<std::string> MakeRows() {
    std::vector<std::string> rows;
    std::vector<std::size_t> next(tables_.size());
    for (std::size_t i = 0; i < table_of_row_.size() && reader_.is_good(); ++i) {
      const std::size_t table = table_of_row_[i];
      rows.push_back(MakeOne(tables_[table], next[table]++));
    }
    return rows;
  }

  std::string MakeOne(const Table& table, std::size_t row) {
    values_.numbers.clear();
    values_.texts.clear();
    for (const auto& column : table.numbers) values_.numbers.push_back(column[row]);
    for (const auto& column : table.texts) values_.texts.push_back(column[row]);
    scratch_.resize(std::max(scratch_.size(), RowBytesMax(table.shape, values_)));
    char* const end = scratch_.data() + scratch_.size();
    const char* const begin = MakeRow(table.shape, values_, end);
    const std::size_t size = static_cast<std::size_t>(end - begin);
    if (size > bytes_left_) {
      reader_.Fail();
      return {};
    }
    bytes_left_ -= size;
    return std::string(begin, size);
  }

  std::size_t bytes_left_;
  ByteReader& reader_;
  std::vector<Table> tables_;
  std::vector<std::uint64_t> table_of_row_;
  RowValues values_;
  std::string scratch_;
};

}  // namespace

void PutRows(const std::vector<std::string_view>& contents, std::string& bytes) {
  Check(contents.size() <= kRowsMax, "no more rows than a batch may have");
  RowEncoder encoder;
  for (const std::string_view content : contents) encoder.Add(content);
  encoder.Put(bytes);
}

std::vector<std::string> TakeRows(std::size_t content_bytes_max, ByteReader& reader) {
  return RowDecoder(content_bytes_max, reader).Take();
}

}  // namespace moondb
