// Status of a run from its folder, for any scenario: whether it can be resumed, and which program wrote it.
#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>

#include <pliant/base/ranks.h>
#include <pliant/io/checkpoint.h>
#include <pliant/io/folder_lock.h>
#include <pliant/io/run_writer.h>
#include <pliant/run/options.h>

namespace pliant {

/// The scenario in the files of a simulation that a Python program builds.
constexpr const char* python_scenario = "simulation";

/// Creates a new run, or continues from a checkpoint: the checkpoint of -restart, or of a stopped or killed run in the
/// same folder, because repeating a command resumes its run. A run killed before its first checkpoint or frame is
/// removed. If p.branches(options), the run of -restart is not changed, and a branch that has begun in -output
/// continues there. `lock` becomes the lock of the folder, on the root: keep it as long as the run writes. `options`,
/// to which `p` is bound, gets the stored values before `make` gets the checkpoint. If `make` or an earlier step fails
/// with the newer of two checkpoints, or run.h5 has fewer data than this checkpoint counts, a warning gives the reason,
/// and the older checkpoint is tried. Therefore `make` must check all values that it reads before it makes a lasting
/// change. Collective. Errors: InputError if -output holds a run that is not a branch of -restart, another process uses
/// the folder, the folder holds a run that has ended, or no checkpoint is usable; OutputError.
void make_run(std::string_view scenario, const RunOptions& p, Options& options, const Ranks& ranks, FolderLock& lock,
              const std::function<void(std::optional<Checkpoint>)>& make);

/// Origin of a branch in this folder: "run" (its folder), "t" and "step"; null for other runs.
nlohmann::ordered_json branch_of(const std::filesystem::path& folder);

/// Makes the folder of a branch, on the root: branch.json, a copy of the checkpoint, which is of time t and this step,
/// and a copy of the run.h5 next to it. run.h5 is written last: a folder without run.h5 is not a branch yet. Returns
/// the copy of the checkpoint. Errors: InputError, OutputError.
std::filesystem::path begin_branch(const std::filesystem::path& checkpoint, Real t, std::int64_t step,
                                   const std::filesystem::path& folder);

Manifest make_manifest(std::string_view scenario, std::string_view model, int dim, std::int64_t seed,
                       const Options& options);

/// The head of summary.json.
nlohmann::ordered_json summary_head(std::string_view scenario, std::string_view model, std::string_view status,
                                    std::string_view ended_by, const Options& options);

}  // namespace pliant
