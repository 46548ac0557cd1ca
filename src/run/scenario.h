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

/// The parameters of a scenario and how a run is made from them: option_scenario().
class ScenarioParameters {
 public:
  ScenarioParameters() = default;
  ScenarioParameters(const ScenarioParameters&) = delete;
  ScenarioParameters& operator=(const ScenarioParameters&) = delete;
  virtual ~ScenarioParameters() = default;

  virtual std::unique_ptr<ScenarioParameters> copy() const = 0;
  virtual RunOptions& run_options() = 0;
  virtual void bind(Options& options) = 0;
  virtual void take_start(std::optional<Checkpoint>& checkpoint) = 0;
  virtual void resolve() = 0;
  /// The run refers to these parameters, which outlive it.
  virtual std::unique_ptr<AnyRun> make(const Options& options, const Ranks& ranks,
                                       std::optional<Checkpoint> checkpoint) const = 0;
};

/// See option_scenario().
Scenario scenario_of(std::string name, std::string help, std::shared_ptr<const ScenarioParameters> defaults,
                     std::vector<std::string> most_used);

/// A scenario that is described by options. Parameters: a RunOptions with bind(Options&), which is called first;
/// optionally take_start(checkpoint), which takes the particles of -start; and resolve(), which fills in automatic
/// values and throws InputError for inconsistent options. Messages of a run name -dt and -t_end: both must be among the
/// options. defaults: before any option is read. most_used: names of options, with which the text of -help begins.
template <class Parameters>
Scenario option_scenario(std::string name, std::string help, MakeRun<Parameters> make,
                         Parameters defaults = Parameters(), std::vector<std::string> most_used = {}) {
  class Own final : public ScenarioParameters {
   public:
    Own(Parameters defaults, MakeRun<Parameters> make) : p_(std::move(defaults)), make_(std::move(make)) {}
    std::unique_ptr<ScenarioParameters> copy() const override { return std::make_unique<Own>(p_, make_); }
    RunOptions& run_options() override { return p_; }
    void bind(Options& options) override { p_.bind(options); }
    void take_start(std::optional<Checkpoint>& checkpoint) override {
      if constexpr (requires { p_.take_start(checkpoint); }) p_.take_start(checkpoint);
    }
    void resolve() override { p_.resolve(); }
    std::unique_ptr<AnyRun> make(const Options& options, const Ranks& ranks,
                                 std::optional<Checkpoint> checkpoint) const override {
      return make_(p_, options, ranks, std::move(checkpoint));
    }

   private:
    Parameters p_;
    MakeRun<Parameters> make_;
  };
  return scenario_of(std::move(name), std::move(help), std::make_shared<Own>(std::move(defaults), std::move(make)),
                     std::move(most_used));
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
