#include <pliant/run/scenario.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <new>

#include <pliant/base/console.h>
#include <pliant/base/errors.h>
#include <pliant/base/log.h>
#include <pliant/base/nearest.h>
#include <pliant/base/petsc.h>
#include <pliant/base/version.h>
#include <pliant/run/folder.h>
#include <pliant/run/run_control.h>

namespace pliant {
namespace {

const char* const reference = "-help_markdown";
const char* const machine_reference = "-help_json";

void answer(const Ranks& ranks, const std::string& text) {
  ranks.on_root([&] { print_result(text); });
}

std::string usage(const std::vector<Scenario>& scenarios) {
  const std::string& program = program_name();
  std::string text = fmt::format("usage: {} SCENARIO [-option value ...]\n\nscenarios:\n", program);
  for (const Scenario& s : scenarios)
    text += fmt::format("  {:<18}  {}\n", s.arguments.empty() ? s.name : s.name + " " + s.arguments, s.help);
  return text + fmt::format(
                    "\n{0} SCENARIO -help   options of a scenario\n{0} SCENARIO -help GROUP   one group of them\n"
                    "{0} -version         version and build\n"
                    "{0} -scenarios       names of the scenarios that have options, for scripts\n",
                    program);
}

/// The names for pliant-sweep; the first name is its default.
std::string names_of(const std::vector<Scenario>& scenarios) {
  std::string text;
  for (const Scenario& s : scenarios)
    if (s.arguments.empty()) text += s.name + "\n";
  return text;
}

/// The source of docs/reference/options.md.
void print_reference(const std::vector<Scenario>& scenarios, const Ranks& ranks) {
  for (const Scenario& s : scenarios) {
    if (!s.arguments.empty()) continue;
    answer(ranks, fmt::format("\n# Options of `{} {}`\n\n{}{}", program_name(), s.name, s.units,
                              s.units.empty() ? "" : "\n\n"));
    s.run({reference}, ranks);
  }
}

ExitCode run(const std::vector<Scenario>& scenarios, const std::string& name, const Arguments& arguments,
             const Ranks& ranks) {
  for (const Scenario& s : scenarios)
    if (s.name == name) return s.run(arguments, ranks);
  if (name == "-help" || name == "--help" || name == "-h") {
    answer(ranks, usage(scenarios));
    return ExitCode::done;
  }
  if (name == "-version" || name == "--version") {
    answer(ranks, build_info().text());
    return ExitCode::done;
  }
  if (name == "-scenarios") {
    answer(ranks, names_of(scenarios));
    return ExitCode::done;
  }
  if (name == reference) {
    print_reference(scenarios, ranks);
    return ExitCode::done;
  }
  std::vector<std::string> names;
  for (const Scenario& s : scenarios) names.push_back(s.name);
  const auto near = nearest(name, names);
  throw InputError("unknown scenario '{}'{}; {} -help lists them", name,
                   near ? fmt::format(", did you mean '{}'?", *near) : std::string(), program_name());
}

/// Prints the error, once. An error of all ranks ends the program in order; an error of some ranks leaves the other
/// ranks waiting, and ends them too.
int fail(const Ranks& ranks, const std::string& message, ExitCode code) {
  const bool shared = ranks.meet(std::chrono::seconds(2));
  if (ranks.root() || !shared) complain(fmt::format("{}: error: {}\n", program_name(), message));
  if (!shared) MPI_Abort(ranks.comm(), static_cast<int>(code));
  return static_cast<int>(code);
}

/// Where there is no memory for a message with numbers. Returns the exit code.
int complain_without_memory() {
  constexpr std::string_view text =
      "pliant: error: out of memory; free memory on this machine, then run the same again\n";
  (void)!::write(STDERR_FILENO, text.data(), text.size());
  return static_cast<int>(ExitCode::out_of_memory);
}

/// Reports the exception that is being handled. Returns its exit code.
int complain_in_flight() {
  try {
    const Error error = error_in_flight();
    complain(fmt::format("{}: error: {}\n", program_name(), error.what()));
    return static_cast<int>(error.code());
  } catch (...) {
    return complain_without_memory();
  }
}

/// -help, -version, -help_markdown or -help_json is answered; otherwise true: to be run.
bool parse_arguments(const std::string& scenario, Options& options, const Arguments& arguments, const Ranks& ranks) {
  if (arguments == Arguments{reference}) {
    answer(ranks, options.markdown());
    return false;
  }
  if (arguments == Arguments{machine_reference}) {
    answer(ranks, options.reference().dump(1) + "\n");
    return false;
  }
  switch (options.parse(arguments)) {
    case Options::Request::help:
      answer(ranks, fmt::format("usage: {} {} [-option value ...]\n\n", program_name(), scenario) +
                        options.help(options.help_group()));
      return false;
    case Options::Request::version:
      answer(ranks, build_info().text());
      return false;
    case Options::Request::run:
      break;
  }
  return true;
}

/// Runs a scenario of this name, new or continued, and writes its folder. p is bound to `options`, which are stored
/// with the run. Returns done, or stopped if a checkpoint was written and the same command resumes. Errors: InputError
/// before any work; NumericalError and OutputError with all earlier data intact. Collective.
ExitCode run_alone(const std::string& scenario, ScenarioParameters& parameters, Options& options, const Ranks& ranks) {
  RunOptions& p = parameters.run_options();
  if (!p.ensemble_over.empty())
    throw InputError("-ensemble_over {}: give the number of runs with each value, -ensemble", p.ensemble_over);
  if (p.ensemble_workers > 0)
    throw InputError("-ensemble_workers {}: a single run has no runs at a time; give -ensemble, or leave it out",
                     p.ensemble_workers);
  start_log();
  const CureOptions cure_options([&](Cure cure) { return options.curing(cure); });
  FolderLock lock;  // held until the run has closed its files
  std::unique_ptr<AnyRun> run;
  make_run(scenario, p, options, ranks, lock, [&](std::optional<Checkpoint> checkpoint) {
    if (!p.restart.empty() && !p.branches(options)) p.output = p.restart;
    parameters.take_start(checkpoint);
    parameters.resolve();
    run = parameters.make(options, ranks, std::move(checkpoint));
  });
  return run->run();
}

/// Makes and runs a member of an ensemble.
ExitCode run_member(ScenarioParameters& parameters, const Arguments& arguments, const Ranks& ranks,
                    MemberOutput& output) {
  RunOptions& p = parameters.run_options();
  Options options;
  parameters.bind(options);
  options.parse(arguments);
  p.threads = 1;
  p.max_wall_time = 0;
  p.member = &output;
  start_log();
  const CureOptions cure_options([&](Cure cure) { return options.curing(cure); });
  std::optional<Checkpoint> none;
  parameters.take_start(none);
  parameters.resolve();
  return parameters.make(options, ranks, {})->run();
}

std::terminate_handler other_terminate = nullptr;

/// For destructors that need memory, such as the destructor of nlohmann::json.
[[noreturn]] void on_terminate() {
  try {
    if (const auto error = std::current_exception()) std::rethrow_exception(error);
  } catch (const std::bad_alloc&) {
    std::_Exit(complain_without_memory());
  } catch (...) {
    if (other_terminate != nullptr) other_terminate();
  }
  std::abort();
}

}  // namespace

Scenario scenario_of(std::string name, std::string help, std::shared_ptr<const ScenarioParameters> defaults,
                     std::vector<std::string> most_used) {
  Scenario s{.name = name, .help = std::move(help), .run = {}};
  s.table = [defaults] {
    const auto parameters = defaults->copy();
    Options options;
    parameters->bind(options);
    return options.table();
  };
  s.run = [name = std::move(name), defaults = std::move(defaults), most_used = std::move(most_used)](
              const Arguments& arguments, const Ranks& ranks) {
    const auto parameters = defaults->copy();
    Options options;
    parameters->bind(options);
    options.most_used(most_used);
    if (!parse_arguments(name, options, arguments, ranks)) return ExitCode::done;
    const RunOptions& p = parameters->run_options();
    if (p.ensemble == 0) return run_alone(name, *parameters, options, ranks);
    return run_ensemble(name, p, options, ranks, [&](const Arguments& more, MemberOutput& output) {
      Arguments all = arguments;
      all.insert(all.end(), more.begin(), more.end());
      return run_member(*defaults->copy(), all, ranks, output);
    });
  };
  return s;
}

int run_program(int argc, char** argv, const std::vector<Scenario>& scenarios) {
  guard_standard_streams();
  std::signal(SIGXFSZ, SIG_IGN);  // a write beyond the limit on files fails, and is reported, instead of killing
  const InheritedSignals signals;
  if (std::get_terminate() != on_terminate) other_terminate = std::set_terminate(on_terminate);
  try {
    if (argc > 0) set_program_name(std::filesystem::path(argv[0]).filename().string());
    const Arguments arguments(argv + std::min(argc, 2), argv + argc);
    PetscSession petsc;
    signals.restore();
    const Ranks ranks(PETSC_COMM_WORLD);
    int code = 0;
    try {
      if (argc < 2) throw InputError("no scenario given; {} -help lists them", program_name());
      code = static_cast<int>(run(scenarios, argv[1], arguments, ranks));
    } catch (...) {
      const Error error = error_in_flight();
      code = fail(ranks, error.what(), error.code());
    }
    petsc.end();
    return code;
  } catch (...) {
    return complain_in_flight();
  }
}

}  // namespace pliant
