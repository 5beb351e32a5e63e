#include <CLI/CLI.hpp>
#include <exception>

#include "client/commands.h"
#include "client/print.h"
#include "rpc/standard_output.h"

int main(int argc, char** argv) {
  CLI::App app(
      "Woodcock renders scenes with participating media, here or on a cluster, to the same bits.\n"
      "Every command explains itself with --help.",
      "woodcock");
  app.require_subcommand(1);
  app.set_version_flag("--version", WOODCOCK_VERSION);
  app.footer(
      "Begin with:\n"
      "  woodcock render scenes/cornell.pbrt -o cornell.exr     render here\n"
      "  woodcock explain scenes/cloud.pbrt                     what the scene calls for\n"
      "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 the job ended with parts missing.");
  int code = 0;
  woodcock::add_render_command(app, code);
  woodcock::add_merge_command(app, code);
  woodcock::add_compare_command(app, code);
  woodcock::add_quote_command(app, code);
  woodcock::add_explain_command(app, code);
  woodcock::add_estimators_command(app, code);
  woodcock::add_resolve_command(app, code);
  woodcock::add_submit_command(app, code);
  woodcock::add_jobs_command(app, code);
  woodcock::add_show_command(app, code);
  woodcock::add_watch_command(app, code);
  woodcock::add_fetch_command(app, code);
  woodcock::add_cancel_command(app, code);
  woodcock::add_pause_command(app, code);
  woodcock::add_resume_command(app, code);
  woodcock::add_repin_command(app, code);
  woodcock::add_extend_command(app, code);
  woodcock::add_delete_command(app, code);
  woodcock::add_retain_command(app, code);
  woodcock::add_workers_command(app, code);
  woodcock::add_sweep_command(app, code);
  woodcock::add_up_command(app, code);
  woodcock::add_doctor_command(app, code);
  woodcock::add_selftest_command(app, code);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    // Help and version are no errors; everything else is wrong usage.
    code = app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& error) {
    woodcock::note("woodcock: {}\n", woodcock::Lines{error.what()});
    return 1;
  }
  return woodcock::rpc::exit_code_with_output(code, "woodcock");
}
