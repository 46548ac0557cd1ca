#include <pliant/scenarios/run_folder.h>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <utility>
#include <vector>

#include <pliant/base/console.h>
#include <pliant/base/version.h>

namespace pliant {
namespace {

namespace fs = std::filesystem;

/// Status in the summary of a run's folder; empty if there is none that can be read.
std::string stored_status(const fs::path& folder) {
  std::ifstream file(folder / "summary.json");
  const nlohmann::json summary = nlohmann::json::parse(file, nullptr, false);
  return summary.is_object() && summary.contains("status") && summary["status"].is_string()
             ? std::string(summary["status"])
             : "";
}

/// The root's paths, on all ranks.
std::vector<std::string> shared_names(const Ranks& ranks, const std::vector<fs::path>& paths) {
  std::vector<char> text;
  for (const fs::path& path : paths) {
    const std::string name = path.string() + '\0';
    text.insert(text.end(), name.begin(), name.end());
  }
  ranks.broadcast(text);
  std::vector<std::string> names;
  for (auto at = text.begin(); at != text.end(); at += static_cast<std::ptrdiff_t>(names.back().size()) + 1)
    names.emplace_back(&*at);
  return names;
}

/// Gives `options` what the checkpoint has stored.
void take_options(std::string_view scenario, const Checkpoint& checkpoint, Options& options) {
  if (const std::string& own = checkpoint.text("scenario"); own != scenario)
    throw InputError("{}: the checkpoint is of scenario '{}', not of {}",
                     fs::path(checkpoint.file).parent_path().string(), own, scenario);
  const nlohmann::json stored = nlohmann::json::parse(checkpoint.text("options"), nullptr, false);
  try {
    options.from_json(stored);
  } catch (const RestartConflict&) {
    throw;
  } catch (const Error& error) {
    checkpoint.refuse("{}", error.what());
  }
}

}  // namespace

void make_run(std::string_view scenario, const RunOptions& p, Options& options, const Ranks& ranks,
              const std::function<void(std::optional<Checkpoint>)>& make) {
  const bool again = p.restart.empty() && stored_status(p.output) == "stopped";
  if (!p.restart.empty() && options.given("output") &&
      fs::weakly_canonical(p.output) != fs::weakly_canonical(p.restart))
    throw InputError("-output {}: -restart {} goes on in its own folder; leave -output out", p.output, p.restart);
  if (!again && p.restart.empty()) return make({});
  const fs::path folder = again ? p.output : p.restart;
  StoredCheckpoints stored;
  ranks.on_root([&] { stored = find_checkpoints(folder); });
  std::vector<std::string> problems = std::move(stored.problems);
  for (const std::string& file : shared_names(ranks, stored.files)) {
    std::string problem;
    try {
      std::optional<Checkpoint> checkpoint;
      ranks.together([&] { checkpoint = read_checkpoint(file); });
      const std::int64_t step = checkpoint->step;
      take_options(scenario, *checkpoint, options);
      make(std::move(checkpoint));
      if (!problems.empty() && ranks.root())
        warn("{}; going on from {} (step {})", fmt::join(problems, "; "), file, step);
      return;
    } catch (const RestartConflict&) {
      throw;
    } catch (const Error& error) {
      problem = error.what();
    } catch (const std::exception& error) {
      problem = fmt::format("{} cannot be used: {}", file, error.what());
    }
    // What the user asks for can be as wrong with both.
    if (std::find(problems.begin(), problems.end(), problem) == problems.end()) problems.push_back(problem);
    options.reset();
  }
  ranks.on_root([&] { throw InputError("{}", fmt::join(problems, "; ")); });
}

Manifest make_manifest(std::string_view scenario, std::string_view model, int dim, std::int64_t seed,
                       const Options& options) {
  const BuildInfo build = build_info();
  Manifest m;
  m.version = build.version;
  m.build = build.build();
  m.petsc_version = build.petsc;
  m.scenario = scenario;
  m.model = model;
  m.created = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  m.dim = dim;
  m.seed = seed;
  m.options = options.json();
  return m;
}

nlohmann::ordered_json summary_head(std::string_view scenario, std::string_view model, std::string_view status,
                                    std::string_view ended_by, const Options& options) {
  nlohmann::ordered_json s;
  s["program"] = "pliant";
  s["version"] = build_info().version;
  s["scenario"] = scenario;
  s["model"] = model;
  s["status"] = status;
  if (status == "done") s["ended_by"] = ended_by;
  s["parameters"] = options.json();
  return s;
}

}  // namespace pliant
