#include "coordinator/statement_cache.h"

#include <memory>
#include <string>
#include <unordered_map>
#include <utility>

namespace woodcock::coordinator {
namespace {

using soci::details::session_backend;
using soci::details::statement_backend;

/// Compiled statements that nobody uses now.
class KeptStatements {
 public:
  KeptStatements() = default;
  KeptStatements(const KeptStatements&) = delete;
  KeptStatements& operator=(const KeptStatements&) = delete;
  ~KeptStatements() {
    for (const auto& [text, statement] : kept_) sqlite_api::sqlite3_finalize(statement);
  }

  /// Null where there is none of this text, or somebody uses it.
  sqlite_api::sqlite3_stmt* take(const std::string& text) {
    const auto found = kept_.find(text);
    if (found == kept_.end()) return nullptr;
    sqlite_api::sqlite3_stmt* const statement = found->second;
    kept_.erase(found);
    return statement;
  }

  void give_back(const std::string& text, sqlite_api::sqlite3_stmt* statement) {
    // It ends here as it would when it is destroyed: it holds no lock, and none of the texts that were bound to it.
    sqlite_api::sqlite3_reset(statement);
    sqlite_api::sqlite3_clear_bindings(statement);
    // Tables are made once.
    const bool once = !sqlite_api::sqlite3_stmt_readonly(statement) && sqlite_api::sqlite3_bind_parameter_count(statement) == 0;
    if (once || kept_.size() >= kMaxKeptStatements || !kept_.emplace(text, statement).second) sqlite_api::sqlite3_finalize(statement);
  }

 private:
  std::unordered_map<std::string, sqlite_api::sqlite3_stmt*> kept_;
};

/// SOCI's statement, whose compiled form comes from what is kept and goes back there. SOCI's own classes cannot be derived from: its
/// library keeps their symbols to itself.
class Statement final : public statement_backend {
 public:
  Statement(session_backend& session, KeptStatements& kept)
      : kept_(kept), soci_(session.make_statement_backend()), state_(static_cast<soci::sqlite3_statement_backend&>(*soci_)) {}
  ~Statement() override { give_back(); }

  void prepare(const std::string& query, soci::details::statement_type type) override {
    give_back();
    text_ = query;
    if (sqlite_api::sqlite3_stmt* const statement = kept_.take(query)) {
      soci_->clean_up();
      state_.stmt_ = statement;
      state_.databaseReady_ = true;
    } else {
      soci_->prepare(query, type);
    }
  }
  void clean_up() override {
    give_back();
    soci_->clean_up();
  }

  void alloc() override { soci_->alloc(); }
  exec_fetch_result execute(int number) override { return soci_->execute(number); }
  exec_fetch_result fetch(int number) override { return soci_->fetch(number); }
  long long get_affected_rows() override { return soci_->get_affected_rows(); }
  int get_number_of_rows() override { return soci_->get_number_of_rows(); }
  std::string get_parameter_name(int index) const override { return soci_->get_parameter_name(index); }
  std::string rewrite_for_procedure_call(const std::string& query) override { return soci_->rewrite_for_procedure_call(query); }
  int prepare_for_describe() override { return soci_->prepare_for_describe(); }
  void describe_column(int number, soci::data_type& type, std::string& name) override { soci_->describe_column(number, type, name); }
  soci::details::standard_into_type_backend* make_into_type_backend() override { return soci_->make_into_type_backend(); }
  soci::details::standard_use_type_backend* make_use_type_backend() override { return soci_->make_use_type_backend(); }
  soci::details::vector_into_type_backend* make_vector_into_type_backend() override { return soci_->make_vector_into_type_backend(); }
  soci::details::vector_use_type_backend* make_vector_use_type_backend() override { return soci_->make_vector_use_type_backend(); }

 private:
  void give_back() {
    if (auto* const statement = std::exchange(state_.stmt_, nullptr)) kept_.give_back(text_, statement);
  }

  KeptStatements& kept_;
  const std::unique_ptr<statement_backend> soci_;
  soci::sqlite3_statement_backend& state_;  // of soci_
  std::string text_;
};

class Session final : public session_backend {
 public:
  explicit Session(const soci::connection_parameters& parameters) : soci_(soci::factory_sqlite3()->make_session(parameters)) {}

  sqlite_api::sqlite3* connection() const { return static_cast<soci::sqlite3_session_backend&>(*soci_).conn_; }

  bool is_connected() override { return soci_->is_connected(); }
  void begin() override { soci_->begin(); }
  void commit() override { soci_->commit(); }
  void rollback() override { soci_->rollback(); }
  bool get_last_insert_id(soci::session& session, const std::string& table, long long& value) override {
    return soci_->get_last_insert_id(session, table, value);
  }
  std::string get_table_names_query() const override { return soci_->get_table_names_query(); }
  std::string create_column_type(soci::data_type type, int precision, int scale) override {
    return soci_->create_column_type(type, precision, scale);
  }
  std::string empty_blob() override { return soci_->empty_blob(); }
  std::string get_dummy_from_table() const override { return soci_->get_dummy_from_table(); }
  std::string get_backend_name() const override { return soci_->get_backend_name(); }
  statement_backend* make_statement_backend() override { return new Statement(*soci_, kept_); }
  soci::details::rowid_backend* make_rowid_backend() override { return soci_->make_rowid_backend(); }
  soci::details::blob_backend* make_blob_backend() override { return soci_->make_blob_backend(); }

 private:
  const std::unique_ptr<session_backend> soci_;
  KeptStatements kept_;  // gone before the connection
};

class Factory final : public soci::backend_factory {
 public:
  session_backend* make_session(const soci::connection_parameters& parameters) const override { return new Session(parameters); }
};

}  // namespace

const soci::backend_factory& caching_sqlite3() {
  static const Factory factory;
  return factory;
}

sqlite_api::sqlite3* connection_of(soci::session& session) { return static_cast<Session*>(session.get_backend())->connection(); }

}  // namespace woodcock::coordinator
