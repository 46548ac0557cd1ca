// Ensembles: many runs of one scenario in one file, in several processes.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/base/ranks.h>
#include <pliant/run/options.h>

namespace pliant {

/// The output of a run that is a member of an ensemble.
struct MemberOutput {
  nlohmann::ordered_json summary;    ///< as in summary.json; null before the end of the run
  std::vector<std::string> results;  ///< names in the summary that the scenario has measured
  std::string objects;               ///< a message with the content of run.h5 (io/recording.h)
};

/// Makes and runs a member: the scenario with the arguments of the ensemble, and these after them. Errors: as of a run.
using RunMember = std::function<ExitCode(const std::vector<std::string>& more, MemberOutput& output)>;

/// Runs an ensemble, or the members that a killed or stopped one has not run yet: p.ensemble runs with the seeds from
/// p.seed on, for each value of p.ensemble_over. Each member runs on one thread, with the results that it has alone;
/// p.ensemble_workers members run at a time, each in a process, because two threads must not call PETSc or HDF5 at
/// once. Writes ensemble.h5, members.csv and summary.json. Returns done, stopped, or numerical_failure if members
/// failed. Errors: InputError for options that do not fit together or another ensemble in the folder; OutputError.
ExitCode run_ensemble(const std::string& scenario, const RunOptions& p, const Options& options, const Ranks& ranks,
                      const RunMember& run);

}  // namespace pliant
