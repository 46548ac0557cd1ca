#include <pliant/scenarios/run_folder.h>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>
#include <filesystem>
#include <fstream>

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

}  // namespace

std::optional<Checkpoint> checkpoint_to_continue(std::string_view scenario, const RunOptions& p, Options& options,
                                                 const Ranks& ranks) {
  const bool again = p.restart.empty() && stored_status(p.output) == "stopped";
  if (!p.restart.empty() && options.given("output") &&
      fs::weakly_canonical(p.output) != fs::weakly_canonical(p.restart))
    throw InputError("-output {}: -restart {} goes on in its own folder; leave -output out", p.output, p.restart);
  if (!again && p.restart.empty()) return {};
  const fs::path folder = again ? p.output : p.restart;
  NewestCheckpoint newest = read_newest_checkpoint(folder);
  if (!newest.message.empty() && ranks.root()) warn("{}", newest.message);
  if (newest.checkpoint.strings["scenario"] != scenario)
    throw InputError("{}: the checkpoint is of scenario '{}', not of {}", folder.string(),
                     newest.checkpoint.strings["scenario"], scenario);
  options.from_json(nlohmann::json::parse(newest.checkpoint.strings["options"]));
  return std::move(newest.checkpoint);
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
