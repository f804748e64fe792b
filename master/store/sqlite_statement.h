// A prepared statement of SQLite.
#pragma once

#include <sqlite3.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace candela::master {

// A prepared statement: binds in order, reads columns in order or by name.
class Statement {
 public:
  explicit Statement(sqlite3* db, const char* sql) {
    if (sqlite3_prepare_v2(db, sql, -1, &stmt_, nullptr) != SQLITE_OK) stmt_ = nullptr;
    for (int c = 0; c < sqlite3_column_count(stmt_); ++c) names_.emplace_back(sqlite3_column_name(stmt_, c));
  }
  ~Statement() { sqlite3_finalize(stmt_); }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  Statement& bind(std::int64_t v) { return check(sqlite3_bind_int64(stmt_, ++at_, v)); }
  Statement& bind(std::uint64_t v) { return bind(static_cast<std::int64_t>(v)); }
  Statement& bind(std::uint32_t v) { return bind(static_cast<std::int64_t>(v)); }
  Statement& bind(int v) { return bind(static_cast<std::int64_t>(v)); }
  Statement& bind(double v) {  // SQLite has no NaN; it stores NULL
    return check(std::isnan(v) ? sqlite3_bind_null(stmt_, ++at_) : sqlite3_bind_double(stmt_, ++at_, v));
  }
  Statement& bind(const std::string& v) {
    return check(sqlite3_bind_text64(stmt_, ++at_, v.data(), v.size(), SQLITE_TRANSIENT, SQLITE_UTF8));
  }
  Statement& bind_blob(const std::string& v) {
    return check(sqlite3_bind_blob64(stmt_, ++at_, v.data(), v.size(), SQLITE_TRANSIENT));
  }

  // True while there is a row; false at the end or on an error (see failed()).
  bool step() {
    if (stmt_ == nullptr || failed_) return false;
    column_ = 0;
    const int code = sqlite3_step(stmt_);
    if (code == SQLITE_ROW) return true;
    if (code != SQLITE_DONE) failed_ = true;
    return false;
  }
  bool run() {  // for statements without rows
    step();
    return !failed();
  }
  bool failed() const { return failed_ || stmt_ == nullptr; }
  // The same statement once more.
  void reset() {
    sqlite3_reset(stmt_);
    at_ = 0;
  }

  // Goes to the column of this name, which the next call reads. The search begins at the next column: callers
  // mostly read columns in order.
  Statement& column(std::string_view name) {
    const int columns = static_cast<int>(names_.size());
    for (int i = 0; i < columns; ++i)
      if (const int c = (column_ + i) % columns; names_[static_cast<std::size_t>(c)] == name) {
        column_ = c;
        return *this;
      }
    failed_ = true;
    column_ = columns;  // reads as NULL
    return *this;
  }
  std::int64_t integer() { return sqlite3_column_int64(stmt_, column_++); }
  std::uint64_t count() { return static_cast<std::uint64_t>(integer()); }
  double real() {
    const int c = column_++;
    return sqlite3_column_type(stmt_, c) == SQLITE_NULL ? std::numeric_limits<double>::quiet_NaN()
                                                        : sqlite3_column_double(stmt_, c);
  }
  std::string text() {
    const int c = column_++;
    const void* data = sqlite3_column_blob(stmt_, c);
    const auto size = static_cast<std::size_t>(sqlite3_column_bytes(stmt_, c));
    return data == nullptr ? std::string() : std::string(static_cast<const char*>(data), size);
  }

 private:
  Statement& check(int code) {
    if (code != SQLITE_OK) failed_ = true;
    return *this;
  }
  sqlite3_stmt* stmt_ = nullptr;
  std::vector<std::string> names_;
  int at_ = 0;
  int column_ = 0;
  bool failed_ = false;
};

}  // namespace candela::master
