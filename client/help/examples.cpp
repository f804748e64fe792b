// Examples of all commands. A test parses each of them with the program's own parser.
#include <CLI/CLI.hpp>
#include <map>
#include <string_view>
#include <vector>

#include "client/help/command_tree.h"

namespace candela::client {
namespace {

const std::map<std::string_view, std::vector<std::string_view>>& examples() {
  static const std::map<std::string_view, std::vector<std::string_view>> all = {
      {"render",
       {"candela render scene.xml -o out.exr --png out.png --iterations 256",
        "candela render scene.xml -o out.exr --integrator vcm --until relmse=1e-3",
        "candela render scene.xml -o out.exr --iterations 1024 --resume",
        "candela render scene.xml -o out.exr --until relmse=1e-3 --page localhost:9090 --page-stay",
        "candela render scene.xml -o out.exr --png out.png --preview 5s --tev localhost:14158"}},
      {"reproduce",
       {"candela reproduce out.exr", "candela reproduce out.exr --run",
        "candela reproduce out.exr --run -o again.exr --scene moved/scene.xml --master farm:7070"}},
      {"plan", {"candela plan scene.xml --integrator bdpt"}},
      {"objects", {"candela objects scene.xml --json"}},
      {"check", {"candela check scene.xml --strict"}},
      {"submit",
       {"candela submit scene.xml --master farm:7070 --iterations 1024",
        "candela submit scene.xml --time 10m --wait -o out.exr",
        "candela submit scene.xml --frames 1-240 -D frame={frame} --name shot.{frame:4}",
        "candela submit comp.xml --depends shot"}},
      {"list",
       {"candela list --master farm:7070", "candela list --state running,queued --limit 20",
        "candela list --mine --name 'seq010*'", "candela list shot"}},
      {"show", {"candela show j7k2m --json", "candela show kitchen"}},
      {"watch", {"candela watch j7", "candela watch j7 --tev localhost:14158"}},
      {"fetch",
       {"candela fetch j7 -o out.exr --png out.png --error-layer", "candela fetch j7 --half A -o a.exr",
        "candela fetch shot -o out.{frame:4}.exr", "candela fetch j7 -o mixed.exr --mix mix.json"}},
      {"pause", {"candela pause j7 kitchen"}},
      {"resume", {"candela resume j7"}},
      {"extend", {"candela extend j7 --iterations +512"}},
      {"cancel", {"candela cancel j7"}},
      {"priority", {"candela priority j7 10"}},
      {"verify", {"candela verify j7"}},
      {"repair", {"candela repair j7 --wait"}},
      {"workers",
       {"candela workers --master farm:7070", "candela workers --wanted", "candela workers pause node7"}},
      {"drain", {"candela drain w3 --wait"}},
      {"slurm",
       {"candela slurm --master farm:7070 --workers 20 --cpus 16 --time 8:00:00 --partition render --submit",
        "candela slurm --master farm:7070 --workers 4 --cpus 8 -o workers.sbatch"}},
      {"tls",
       {"candela tls init render.example.org 10.0.0.5 --person alice=operate --person bob=submit",
        "candela tls add carol --role read"}},
      {"events", {"candela events j7 --limit 20"}},
      {"compare", {"candela compare out.exr reference.exr --worst 10"}},
      {"convert",
       {"candela convert out.exr out.png --exposure 1.5",
        "candela convert out.exr depth.tif --layer depth --range 0,20",
        "candela convert out.exr out.jpg --denoise", "candela convert out.exr mixed.exr --mix mix.json"}},
      {"inspect falsecolor",
       {"candela inspect falsecolor out.exr -o luminance.png --log",
        "candela inspect falsecolor out.exr --minus reference.exr -o difference.png --signed",
        "candela inspect falsecolor scene.xml --select 'LS+DE' --spp 64 -o caustics.png"}},
      {"inspect paths",
       {"candela inspect paths scene.xml --pixels 200,150,215,165 --overlay paths.png",
        "candela inspect paths scene.xml --region sphere:0,0,1,0.2 --by object -o paths.json --ply paths.ply",
        "candela inspect paths scene.xml --pixels 0,0,63,63 --select 'L[DGSV]*SDE'"}},
      {"inspect sphere",
       {"candela inspect sphere scene.xml --at 0,1,0 -o around.exr --png around.png --log",
        "candela inspect sphere scene.xml --pixel 200,150 --disc --lobe lobe.ply"}},
      {"inspect volume",
       {"candela inspect volume scene.xml --box -1,0,-1,1,2,1 -o light.vdb --png light.png --log",
        "candela inspect volume scene.xml --box -1,0,-1,1,2,1 --select 'LS+DE' --slices caustic.png --axis "
        "y"}},
      {"doctor", {"candela doctor --master farm:7070 --data /var/lib/candela"}},
      {"completion",
       {"candela completion bash > ~/.local/share/bash-completion/completions/candela",
        "candela completion zsh > ~/.zfunc/_candela"}},
      {"version", {"candela version --json"}},
  };
  return all;
}

}  // namespace

void add_examples(CLI::App& app) {
  for (CLI::App* group : app.get_subcommands([](CLI::App*) { return true; }))
    group->footer("candela " + group->get_name() + " COMMAND --help says more about a command");
  for (const auto& [name, command] : commands_of(app)) {
    const auto found = examples().find(name);
    std::string footer;
    if (found != examples().end()) {
      footer = found->second.size() > 1 ? "Examples:" : "Example:";
      for (const std::string_view line : found->second) footer += "\n  " + std::string(line);
    }
    command->footer(footer);
  }
}

}  // namespace candela::client
