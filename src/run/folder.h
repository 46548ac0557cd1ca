// What the folder of a run says of it, whatever the scenario: whether it goes on, and who made it.
#pragma once

#include <functional>
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
/// the same folder, as the same command again goes on with it. What was killed before it had a checkpoint or a frame is
/// removed. `lock` becomes that of the folder, on the root: keep it as long as the run writes. `options`, to which `p`
/// is bound, gets the stored values before `make` gets the checkpoint. If `make` or anything before it fails with the
/// newer of two checkpoints, or run.h5 has less than it counts on, a warning says why, and the older one is tried:
/// `make` must check all that it reads, and change nothing that lasts before it has. Collective. Errors: InputError
/// where -output contradicts -restart, another process uses the folder, it holds a run that has ended, or no checkpoint
/// can be used; OutputError.
void make_run(std::string_view scenario, const RunOptions& p, Options& options, const Ranks& ranks, FolderLock& lock,
              const std::function<void(std::optional<Checkpoint>)>& make);

Manifest make_manifest(std::string_view scenario, std::string_view model, int dim, std::int64_t seed,
                       const Options& options);

/// The head of summary.json.
nlohmann::ordered_json summary_head(std::string_view scenario, std::string_view model, std::string_view status,
                                    std::string_view ended_by, const Options& options);

}  // namespace pliant
