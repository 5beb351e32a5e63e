// The subcommands of `woodcock`: each adds itself to the command line and returns its exit code through `code`
// (0 done, 1 failed, 2 wrong usage, 3 job ended partial).
#pragma once

#include <CLI/CLI.hpp>

namespace woodcock {

void add_render_command(CLI::App& app, int& code);
void add_merge_command(CLI::App& app, int& code);
void add_compare_command(CLI::App& app, int& code);
void add_quote_command(CLI::App& app, int& code);
void add_explain_command(CLI::App& app, int& code);
void add_estimators_command(CLI::App& app, int& code);
/// Internal: how a coordinator reads the scenes of ScenesService.SubmitScene.
void add_resolve_command(CLI::App& app, int& code);
void add_submit_command(CLI::App& app, int& code);
void add_jobs_command(CLI::App& app, int& code);
void add_show_command(CLI::App& app, int& code);
void add_watch_command(CLI::App& app, int& code);
void add_fetch_command(CLI::App& app, int& code);
void add_cancel_command(CLI::App& app, int& code);
void add_pause_command(CLI::App& app, int& code);
void add_resume_command(CLI::App& app, int& code);
void add_repin_command(CLI::App& app, int& code);
void add_extend_command(CLI::App& app, int& code);
void add_delete_command(CLI::App& app, int& code);
void add_retain_command(CLI::App& app, int& code);
void add_workers_command(CLI::App& app, int& code);
void add_sweep_command(CLI::App& app, int& code);
void add_up_command(CLI::App& app, int& code);
void add_doctor_command(CLI::App& app, int& code);
void add_selftest_command(CLI::App& app, int& code);

}  // namespace woodcock
