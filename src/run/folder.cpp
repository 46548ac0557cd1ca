#include <pliant/run/folder.h>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <new>
#include <utility>
#include <vector>

#include <pliant/base/console.h>
#include <pliant/base/version.h>
#include <pliant/io/atomic_file.h>
#include <pliant/io/json_file.h>

namespace pliant {
namespace {

namespace fs = std::filesystem;

constexpr const char* branch_name = "branch.json";

/// A text of the summary of a run's folder; empty if there is none. Errors: InputError if the summary is damaged.
std::string stored_text(const fs::path& folder, const std::string& name) {
  const auto summary = read_json(folder / "summary.json");
  return summary.is_object() && summary.contains(name) && summary[name].is_string() ? std::string(summary[name]) : "";
}

[[noreturn]] void refuse_ended(const fs::path& folder, const std::string& status, bool checkpoint,
                               const Options& options) {
  const std::string name = folder.string(), option = options.extending(stored_text(folder, "ended_by"));
  std::string extend;
  if (status == "failed")
    throw InputError(
        "{} holds a run that failed ({}); restart from its last checkpoint with -restart {}, or choose another "
        "-output",
        name, stored_text(folder, "message"), name);
  if (checkpoint && !option.empty()) extend = fmt::format("extend it by -restart {} -{}, or ", name, option);
  throw InputError("{} holds a run that is finished ({}); {}choose another -output", name, status, extend);
}

/// State of a command's folder: free for a new run, or a run to resume.
enum class Found { nothing, stopped, killed };

/// Inspects the folder of -output. Errors: InputError if no run can start or continue there.
Found look_into(const fs::path& folder, const Options& options) {
  std::error_code error;
  if (fs::exists(folder / "ensemble.h5", error))
    throw InputError("{} holds an ensemble; choose another -output, or give its options with -ensemble to resume it",
                     folder.string());
  const bool checkpoint = has_checkpoint(folder);
  if (!checkpoint && !fs::exists(folder / "run.h5", error)) return Found::nothing;
  const std::string status = stored_text(folder, "status");
  const bool ended = !status.empty() && status != "stopped";
  if (ended && (checkpoint || status != "failed")) refuse_ended(folder, status, checkpoint, options);
  if (checkpoint) return status == "stopped" ? Found::stopped : Found::killed;
  if (const std::size_t frames = count_frames(folder); frames > 0)
    throw InputError("{} holds {} frames of a run without a checkpoint to resume from; choose another -output",
                     folder.string(), frames);
  say("{}: the run ended before its first checkpoint and frame, and starts again\n", folder.string());
  for (const char* name : {"run.h5", "run.xdmf", "summary.json"})
    if (fs::remove(folder / name, error); error)
      throw OutputError("cannot remove {}: {}; choose another -output", (folder / name).string(), error.message());
  return Found::nothing;
}

/// State of a branching command's folder: free for a branch of the run in `from`, or a branch that has begun.
Found look_for_branch(const fs::path& folder, const fs::path& from, const Options& options) {
  std::error_code error;
  const nlohmann::ordered_json of = branch_of(folder);
  const bool known = !of.is_null(), same = known && of["run"] == fs::weakly_canonical(from).string();
  const bool begun = fs::exists(folder / "run.h5", error);
  if ((begun && !same) || (!begun && !known && has_checkpoint(folder)))
    throw InputError("{} holds a run that is no branch of {}; choose another -output", folder.string(), from.string());
  if (begun) return look_into(folder, options);
  if (const auto holder = holder_of(from))
    throw FolderInUse("{} is in use by {}; wait until it has ended, or stop it by kill, before a branch of it begins",
                      from.string(), *holder);
  return Found::nothing;
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

/// Sets `options` from the checkpoint.
void take_options(std::string_view scenario, const Checkpoint& checkpoint, Options& options) {
  if (const std::string& own = checkpoint.text("scenario"); own != scenario) {
    const std::string folder = fs::path(checkpoint.file).parent_path().string();
    if (own == python_scenario)
      throw InputError(
          "{0} holds a pliant.Simulation of a Python program, which has its callbacks and forces; continue it there "
          "with pliant.Simulation.restart(\"{0}\"), without functions of Python with `python3 -m pliant {0} --until "
          "T`, or "
          "start a new run from its last frame with -start {0}/run.h5",
          folder);
    throw InputError("{} holds a run of scenario '{}', not of {}; choose another folder", folder, own, scenario);
  }
  const nlohmann::json stored = nlohmann::json::parse(checkpoint.text("options"), nullptr, false);
  try {
    options.from_json(stored);
  } catch (const RestartConflict&) {
    throw;
  } catch (const Error& error) {
    checkpoint.refuse("{}", error.what());
  }
}

RunCounts counts_of(const Checkpoint& c) {
  const auto count = [&](const char* name) { return static_cast<std::uint64_t>(c.integer(name)); };
  return {count("samples"), count("frames"), count("events")};
}

}  // namespace

void make_run(std::string_view scenario, const RunOptions& p, Options& options, const Ranks& ranks, FolderLock& lock,
              const std::function<void(std::optional<Checkpoint>)>& make) {
  const bool restart = !p.restart.empty(), branch = p.branches(options);
  fs::path folder = restart && !branch ? p.restart : p.output;  // folder with the checkpoint to continue from
  Found found = Found::stopped;
  StoredCheckpoints stored;
  ranks.on_root([&] {
    if (std::error_code none; !restart || branch || fs::is_directory(folder, none)) lock = FolderLock(folder);
    if (!lock.warning().empty()) warn("{}", lock.warning());
    if (!restart) found = look_into(folder, options);
    if (branch && (found = look_for_branch(folder, p.restart, options)) == Found::nothing) {
      folder = p.restart;
      found = Found::stopped;
    }
    if (found != Found::nothing) stored = find_checkpoints(folder);
  });
  if (ranks.broadcast(found) == Found::nothing) return make({});
  std::vector<std::string> problems = std::move(stored.problems);
  bool fits = true;  // whether run.h5 has the data of the checkpoint; set on the root
  for (const std::string& file : shared_names(ranks, stored.files)) {
    std::string problem;
    try {
      std::optional<Checkpoint> checkpoint;
      ranks.together([&] { checkpoint = read_checkpoint(file); });
      const std::int64_t step = checkpoint->step;
      take_options(scenario, *checkpoint, options);
      ranks.on_root([&] {
        const RunCounts counts = counts_of(*checkpoint);
        fits = false;
        check_counts(folder, counts, file);
        fits = true;
      });
      make(std::move(checkpoint));
      if (found == Found::killed && ranks.root())
        say("{}: the run was killed, and resumes from its last checkpoint\n", folder.string());
      if (!problems.empty() && ranks.root())
        warn("{}; resuming from {} (step {})", fmt::join(problems, "; "), file, step);
      return;
    } catch (const RestartConflict&) {
      throw;
    } catch (const Error& error) {
      if (error.code() == ExitCode::out_of_memory) throw;
      problem = error.what();
    } catch (const std::bad_alloc&) {
      throw;
    } catch (const std::exception& error) {
      problem = fmt::format("{} cannot be used: {}", file, error.what());
    }
    // An error in the user's options occurs with both files.
    if (std::find(problems.begin(), problems.end(), problem) == problems.end()) problems.push_back(problem);
    options.reset();
  }
  ranks.on_root([&] {
    throw InputError(
        "{}{}", fmt::join(problems, "; "),
        stored.files.empty() ? "; without a checkpoint start again, with another -output"
        : fits               ? ""
               : "; close programs that use run.h5, restore it from a backup, or start again with another -output");
  });
}

nlohmann::ordered_json branch_of(const fs::path& folder) {
  auto found = read_json(folder / branch_name);
  return found.is_object() && found.contains("run") ? found : nlohmann::ordered_json();
}

fs::path begin_branch(const fs::path& checkpoint, Real t, std::int64_t step, const fs::path& folder) {
  const fs::path from = checkpoint.parent_path(), copy = folder / checkpoint.filename();
  const nlohmann::ordered_json of{{"run", fs::weakly_canonical(from).string()}, {"t", t}, {"step", step}};
  create_folder(folder);
  write_json(folder / branch_name, of);
  copy_file_atomically(checkpoint, copy);
  copy_file_atomically(from / "run.h5", folder / "run.h5");
  return copy;
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
  m.program = program_name();
  m.created = fmt::format("{:%Y-%m-%dT%H:%M:%SZ}", fmt::gmtime(std::time(nullptr)));
  m.dim = dim;
  m.seed = seed;
  m.options = options.json();
  return m;
}

nlohmann::ordered_json summary_head(std::string_view scenario, std::string_view model, std::string_view status,
                                    std::string_view ended_by, const Options& options) {
  constexpr std::size_t most_entries = 100;  // with more entries all are copied when the object grows
  nlohmann::ordered_json s = nlohmann::ordered_json::object();
  s.get_ref<nlohmann::ordered_json::object_t&>().reserve(most_entries);
  s["program"] = program_name();
  s["version"] = build_info().version;
  s["scenario"] = scenario;
  s["model"] = model;
  s["status"] = status;
  if (status == "done") s["ended_by"] = ended_by;
  s["parameters"] = options.json();
  return s;
}

}  // namespace pliant
