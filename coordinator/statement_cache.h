// SQLite behind SOCI, with the statements that a connection has compiled: SOCI compiles the text of a statement each time that it is used,
// which takes longer than most of them run.
#pragma once

#include <soci/soci.h>
#include <soci/sqlite3/soci-sqlite3.h>

namespace woodcock::coordinator {

/// In the place of soci::sqlite3. A session that it makes keeps up to kMaxKeptStatements compiled statements, by their text, until it ends.
const soci::backend_factory& caching_sqlite3();

inline constexpr size_t kMaxKeptStatements = 200;  // the store has about 80

/// SQLite's connection of a session that caching_sqlite3() made.
sqlite_api::sqlite3* connection_of(soci::session& session);

}  // namespace woodcock::coordinator
