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

/// Makes a run that is new, or goes on from a checkpoint: that of -restart, or of a run that was stopped or killed in
/// the same folder, as the same command again goes on with it. A run killed before its first checkpoint or frame is
/// removed. Where p.branches(options), that of -restart is left as it is, and a branch that has begun in -output goes
/// on there. `lock` becomes that of the folder, on the root: keep it as long as the run writes. `options`, to which `p`
/// is bound, gets the stored values before `make` gets the checkpoint. If `make` or anything before it fails with the
/// newer of two checkpoints, or run.h5 has less than it counts on, a warning says why, and the older one is tried:
/// `make` must check all that it reads, and change nothing that lasts before it has. Collective. Errors: InputError
/// where -output holds another run than a branch of -restart, another process uses the folder, it holds a run that has
/// ended, or no checkpoint can be used; OutputError.
void make_run(std::string_view scenario, const RunOptions& p, Options& options, const Ranks& ranks, FolderLock& lock,
              const std::function<void(std::optional<Checkpoint>)>& make);

/// Where a run in this folder has branched off: "run", its folder, "t" and "step"; null where it is no branch.
nlohmann::ordered_json branch_of(const std::filesystem::path& folder);

/// Makes the folder of a branch, on the root: branch.json, a copy of the checkpoint, which is of time t and this step,
/// and a copy of the run.h5 next to it. The last comes last: a folder without run.h5 is no branch yet. Returns the copy
/// of the checkpoint. Errors: InputError, OutputError.
std::filesystem::path begin_branch(const std::filesystem::path& checkpoint, Real t, std::int64_t step,
                                   const std::filesystem::path& folder);

Manifest make_manifest(std::string_view scenario, std::string_view model, int dim, std::int64_t seed,
                       const Options& options);

/// The head of summary.json.
nlohmann::ordered_json summary_head(std::string_view scenario, std::string_view model, std::string_view status,
                                    std::string_view ended_by, const Options& options);

}  // namespace pliant
