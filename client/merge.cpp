// `woodcock merge`: tiles and partial frames into one EXR.
#include "renderer/film/merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/output_path.h"
#include "client/print.h"
#include "renderer/accuracy/error_summary.h"
#include "renderer/film/picture_file.h"
#include "renderer/film/png.h"

namespace woodcock {
namespace {

struct MergeOptions {
  std::vector<std::string> files;
  std::string output;
  bool json = false;
};

/// The node files of what was named, each once: `*.exr` names a picture and its nodes.
std::vector<std::filesystem::path> node_files(const std::vector<std::string>& named) {
  std::vector<std::filesystem::path> files, beside;
  for (const std::string& file : named) {
    const std::filesystem::path nodes = nodes_of(file);
    (nodes == file ? files : beside).push_back(nodes);
  }
  for (const std::filesystem::path& nodes : beside)
    if (std::none_of(files.begin(), files.end(), [&](const auto& file) { return std::filesystem::equivalent(file, nodes); }))
      files.push_back(nodes);
  return files;
}

int run(const MergeOptions& options) {
  const std::filesystem::path output = output_path(options.output, "", false);
  const NodeFileInfo info = merge_files(node_files(options.files), nodes_path(output), {}, &kErrorSummary, output);
  const std::filesystem::path png = std::filesystem::path(output).replace_extension(".png");
  write_png(nodes_path(output), png);
  if (options.json) {
    nlohmann::json j{{"output", output.string()},
                     {"nodes", nodes_path(output).string()},
                     {"png", png.string()},
                     {"samples", {info.samples.begin, info.samples.end}},
                     {"missing_pixels", info.missing_pixels}};
    say_json(j);
  } else {
    say("{}: samples {} to {} of {}x{} pixels\n", output.string(), info.samples.begin, info.samples.end, info.header.width,
        info.header.height);
  }
  if (info.missing_pixels == 0) return 0;
  note("{} pixels miss samples and have count 0; the gaps are listed in the file's header\n", info.missing_pixels);
  return 3;
}

}  // namespace

void add_merge_command(CLI::App& app, int& code) {
  auto* command = app.add_subcommand("merge", "Put tiles, sample ranges or partial frames together, exactly");
  auto options = std::make_shared<MergeOptions>();
  command->add_option("files", options->files, "EXR files that `render` or `fetch` wrote, with their nodes beside them; or node files")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("-o,--output", options->output, "EXR to write")->required();
  command->add_flag("--json", options->json, "One JSON object on standard output, nothing else there");
  command->footer(
      "Example:\n"
      "  woodcock render scene.pbrt --samples 0:5 -o a.exr\n"
      "  woodcock render scene.pbrt --samples 5:16 -o b.exr\n"
      "  woodcock merge a.exr b.exr -o all.exr       the same bits as one render with --spp 16\n"
      "Overlapping parts, or parts of different scenes, settings, seeds or builds, are refused. Exit code 3: gaps remain.");
  command->callback([options, &code] { code = run(*options); });
}

}  // namespace woodcock
