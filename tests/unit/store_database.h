// A store's SQLite file as tests of its versions see it.
#pragma once

#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <set>
#include <string>

#include "master/store/store.h"

namespace candela::master {

class Database {
 public:
  explicit Database(const std::filesystem::path& path) {
    EXPECT_EQ(sqlite3_open(path.c_str(), &db_), SQLITE_OK);
  }
  ~Database() { sqlite3_close(db_); }
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  void execute(const std::string& sql) {
    EXPECT_EQ(sqlite3_exec(db_, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(db_);
  }
  sqlite3* handle() { return db_; }
  // Tables with their columns in order, types and defaults, and indices.
  std::set<std::string> shape() {
    std::set<std::string> rows;
    sqlite3_exec(
        db_,
        "SELECT m.type, m.name, p.cid, p.name, p.type, p.\"notnull\", p.dflt_value, p.pk FROM sqlite_master "
        "m "
        "LEFT JOIN pragma_table_info(m.name) p ON m.type = 'table' WHERE m.name NOT LIKE 'sqlite_%'",
        [](void* out, int count, char** values, char**) {
          std::string row;
          for (int i = 0; i < count; ++i) row += std::string(values[i] == nullptr ? "-" : values[i]) + " ";
          static_cast<std::set<std::string>*>(out)->insert(row);
          return 0;
        },
        &rows, nullptr);
    return rows;
  }

 private:
  sqlite3* db_ = nullptr;
};

// Statements that take away versions 13 and 14; those and version 12; those and
// version 11; version 10 too. Preconditions: the store is the present one.
#define CANDELA_WITHOUT_GROUPS                                                       \
  "ALTER TABLE jobs DROP COLUMN builds; "                                            \
  "ALTER TABLE jobs DROP COLUMN group_id; ALTER TABLE jobs DROP COLUMN group_name; " \
  "ALTER TABLE jobs DROP COLUMN frame; ALTER TABLE jobs DROP COLUMN frames; "        \
  "ALTER TABLE jobs DROP COLUMN depends; "
inline constexpr const char* kWithoutGroups = CANDELA_WITHOUT_GROUPS;
inline constexpr const char* kWithoutDecisions =
    CANDELA_WITHOUT_GROUPS "ALTER TABLE jobs DROP COLUMN decided; ALTER TABLE jobs DROP COLUMN pilot_form; ";
inline constexpr const char* kWithoutIndices = CANDELA_WITHOUT_GROUPS
    "ALTER TABLE jobs DROP COLUMN decided; ALTER TABLE jobs DROP COLUMN pilot_form; "
    "ALTER TABLE jobs DROP COLUMN stop_indices; ALTER TABLE jobs DROP COLUMN scene_path; ";
#undef CANDELA_WITHOUT_GROUPS
inline constexpr const char* kWithoutAudits =
    "ALTER TABLE jobs DROP COLUMN audit; ALTER TABLE units DROP COLUMN made_by; "
    "ALTER TABLE units DROP COLUMN sha256; DROP TABLE distrusted; "
    "DELETE FROM counters WHERE name = 'audit-secret'";

// Opens the store twice: it has the present shape, and `check(store, state)` looks at its rows.
template <class Check>
void expect_present(const std::filesystem::path& path, const std::set<std::string>& shape, Check&& check) {
  for (int opening = 0; opening < 2; ++opening) {
    auto store = open_sqlite_store(path);
    ASSERT_TRUE(store.ok()) << store.error().to_string();
    EXPECT_EQ(Database(path).shape(), shape);
    const auto state = (*store)->load();
    ASSERT_TRUE(state.ok()) << state.error().to_string();
    check(**store, *state);
  }
}

}  // namespace candela::master
