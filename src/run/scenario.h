// The table of scenarios.
#pragma once

#include <fmt/format.h>

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <pliant/base/options.h>
#include <pliant/base/ranks.h>
#include <pliant/io/checkpoint.h>
#include <pliant/run/ensemble.h>
#include <pliant/run/options.h>
#include <pliant/run/run.h>

namespace pliant {

using Arguments = std::vector<std::string>;

/// An entry of the table.
struct Scenario {
  std::string name, help;
  std::string arguments = {};  ///< arguments that are not options, as the list of scenarios shows them
  std::string units = {};      ///< of the options, in a sentence for the reference
  /// Runs it with the arguments after its name. Collective. Errors are the same on all ranks.
  std::function<ExitCode(const Arguments& arguments, const Ranks& ranks)> run;
  /// Options::table() of its options; empty without options.
  std::function<nlohmann::ordered_json()> table = {};
};

/// Makes a run, new or from a checkpoint, all of which it checks. p is resolved. Errors: InputError.
template <class Parameters>
using MakeRun = std::function<std::unique_ptr<AnyRun>(const Parameters& p, const Options& options, const Ranks& ranks,
                                                      std::optional<Checkpoint> checkpoint)>;

/// Runs a scenario of this name, new or continued, and writes its folder. p: bound to `options`, which are stored with
/// the run. Returns done, or stopped if a checkpoint was written and the same command resumes. Errors: InputError
/// before any work; NumericalError and OutputError with all earlier data intact. Collective.
ExitCode run_by_options(const std::string& scenario, const RunOptions& p, Options& options, const Ranks& ranks,
                        const std::function<std::unique_ptr<AnyRun>(std::optional<Checkpoint>)>& make);

/// Makes and runs a member of an ensemble.
ExitCode run_member(const Options& options, const std::function<std::unique_ptr<AnyRun>()>& make);

/// -help, -version, -help_markdown or -help_json is answered; otherwise true: to be run.
bool parse_arguments(const std::string& scenario, Options& options, const Arguments& arguments, const Ranks& ranks);

/// A scenario that is described by options. Parameters: a RunOptions with bind(Options&), which is called first;
/// optionally take_start(checkpoint), which takes the particles of -start; and resolve(), which fills in automatic
/// values and throws InputError for inconsistent options. Messages of a run name -dt and -t_end: both must be among the
/// options. defaults: before any option is read. most_used: names of options, with which the text of -help begins.
template <class Parameters>
Scenario option_scenario(std::string name, std::string help, MakeRun<Parameters> make,
                         Parameters defaults = Parameters(), std::vector<std::string> most_used = {}) {
  Scenario s{.name = name, .help = std::move(help), .run = {}};
  s.table = [defaults] {
    Parameters p = defaults;
    Options options;
    p.bind(options);
    return options.table();
  };
  s.run = [name = std::move(name), make = std::move(make), defaults = std::move(defaults),
           most_used = std::move(most_used)](const Arguments& arguments, const Ranks& ranks) {
    Parameters p = defaults;
    Options options;
    p.bind(options);
    options.most_used(most_used);
    if (!parse_arguments(name, options, arguments, ranks)) return ExitCode::done;
    if (p.ensemble > 0)
      return run_ensemble(name, p, options, ranks, [&](const Arguments& more, MemberOutput& output) {
        Parameters own = defaults;
        Options of_member;
        own.bind(of_member);
        Arguments all = arguments;
        all.insert(all.end(), more.begin(), more.end());
        of_member.parse(all);
        own.threads = 1;
        own.max_wall_time = 0;
        own.member = &output;
        return run_member(of_member, [&] {
          if constexpr (requires { own.take_start(std::optional<Checkpoint>()); }) {
            std::optional<Checkpoint> none;
            own.take_start(none);
          }
          own.resolve();
          return make(own, of_member, ranks, {});
        });
      });
    return run_by_options(name, p, options, ranks, [&](std::optional<Checkpoint> checkpoint) {
      if (!p.restart.empty() && !p.branches(options)) p.output = p.restart;
      if constexpr (requires { p.take_start(checkpoint); }) p.take_start(checkpoint);
      p.resolve();
      return make(p, options, ranks, std::move(checkpoint));
    });
  };
  return s;
}

/// As above, for a class Own that is a Protocol and is constructed from the parameters, which outlive it, and the
/// ranks.
template <class Parameters, class Own>
Scenario option_scenario(const std::string& name, std::string help) {
  return option_scenario<Parameters>(
      name, std::move(help),
      [name](const Parameters& p, const Options& options, const Ranks& ranks, std::optional<Checkpoint> checkpoint) {
        return std::make_unique<Run<Own::dim>>(name, p, options, ranks, std::make_unique<Own>(p, ranks),
                                               std::move(checkpoint));
      });
}

/// main() of a program with these scenarios: the command line, exit codes and messages of pliant.
int run_program(int argc, char** argv, const std::vector<Scenario>& scenarios);

}  // namespace pliant
