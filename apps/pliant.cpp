// The program: picks a scenario, nothing else.
#include <fmt/format.h>

#include <chrono>
#include <csignal>
#include <string>
#include <vector>

#include <pliant/base/console.h>
#include <pliant/base/errors.h>
#include <pliant/base/nearest.h>
#include <pliant/base/options.h>
#include <pliant/base/petsc.h>
#include <pliant/base/ranks.h>
#include <pliant/base/version.h>
#include <pliant/scenarios/clog/clog.h>
#include <pliant/scenarios/evaluate/evaluate.h>
#include <pliant/scenarios/hopper/hopper.h>
#include <pliant/scenarios/raft/raft.h>

namespace {

using pliant::ExitCode;
using pliant::InputError;
using pliant::Ranks;
using Arguments = std::vector<std::string>;

constexpr const char* usage =
    "usage: pliant SCENARIO [-option value ...]\n"
    "\n"
    "scenarios:\n"
    "  hopper              gravity-driven flow through an orifice\n"
    "  raft                droplets between two walls that compress them or pull them apart\n"
    "  clog                droplets that attract each other leave a hopper, or clog it\n"
    "  evaluate CASE.json  energies and forces of one configuration\n"
    "\n"
    "pliant SCENARIO -help   options of a scenario\n"
    "pliant -version         version and build\n";

void answer(const Ranks& ranks, const std::string& text) {
  ranks.on_root([&] { pliant::print_result(text); });
}

/// A scenario that is run by options.
template <class Parameters>
ExitCode simulate(const char* scenario, ExitCode (*start)(Parameters&, pliant::Options&, const Ranks&),
                  const Arguments& arguments, const Ranks& ranks) {
  Parameters parameters;
  pliant::Options options;
  parameters.bind(options);
  if (arguments == Arguments{"-help_markdown"}) {  // what docs/options.md is made from
    answer(ranks, options.markdown());
    return ExitCode::done;
  }
  switch (options.parse(arguments)) {
    case pliant::Options::Request::help:
      answer(ranks, fmt::format("usage: pliant {} [-option value ...]\n\n", scenario) + options.help());
      break;
    case pliant::Options::Request::version:
      answer(ranks, pliant::build_info().text());
      break;
    case pliant::Options::Request::run:
      return start(parameters, options, ranks);
  }
  return ExitCode::done;
}

void evaluate(const Arguments& arguments) {
  const std::string usage_here = "usage: pliant evaluate CASE.json (docs/evaluate.md describes the file)";
  if (arguments == Arguments{"-help"} || arguments == Arguments{"--help"}) {
    pliant::print_result(usage_here + "\n");
    return;
  }
  if (arguments.size() != 1) throw InputError("{}", usage_here);
  const std::string& file = arguments[0];
  if (file.starts_with('-')) throw InputError("unknown option {}; {}", file, usage_here);
  pliant::print_result(pliant::to_text(pliant::evaluate(pliant::read_case(file), file)) + "\n");
}

ExitCode run(const std::string& scenario, const Arguments& arguments, const Ranks& ranks) {
  if (scenario == "hopper") return simulate("hopper", pliant::run_hopper, arguments, ranks);
  if (scenario == "raft") return simulate("raft", pliant::run_raft, arguments, ranks);
  if (scenario == "clog") return simulate("clog", pliant::run_clog, arguments, ranks);
  if (scenario == "evaluate") {
    ranks.on_root([&] { evaluate(arguments); });
    return ExitCode::done;
  }
  if (scenario == "-help" || scenario == "--help" || scenario == "-h") {
    answer(ranks, usage);
    return ExitCode::done;
  }
  if (scenario == "-version" || scenario == "--version") {
    answer(ranks, pliant::build_info().text());
    return ExitCode::done;
  }
  const std::vector<std::string> scenarios{"hopper", "raft", "clog", "evaluate"};
  const auto near = pliant::nearest(scenario, scenarios);
  throw InputError("unknown scenario '{}'{}; pliant -help lists them", scenario,
                   near ? fmt::format(", did you mean '{}'?", *near) : std::string());
}

/// Says what went wrong, once. Errors that all ranks share end the program in order; one that only some of the ranks
/// have leaves the others waiting, and ends them too.
int fail(const Ranks& ranks, const std::string& message, ExitCode code) {
  const bool shared = ranks.meet(std::chrono::seconds(2));
  if (ranks.root() || !shared) pliant::complain(fmt::format("pliant: error: {}\n", message));
  if (!shared) MPI_Abort(ranks.comm(), static_cast<int>(code));
  return static_cast<int>(code);
}

}  // namespace

int main(int argc, char** argv) {
  pliant::guard_standard_streams();
  std::signal(SIGXFSZ, SIG_IGN);  // a write beyond the limit on files fails, and is reported, instead of killing
  const Arguments arguments(argv + std::min(argc, 2), argv + argc);
  try {
    pliant::PetscSession petsc;
    const Ranks ranks(PETSC_COMM_WORLD);
    int code = 0;
    try {
      if (argc < 2) throw InputError("no scenario given; pliant -help lists them");
      code = static_cast<int>(run(argv[1], arguments, ranks));
    } catch (const pliant::Error& error) {
      code = fail(ranks, error.what(), error.code());
    } catch (const std::exception& error) {
      code = fail(ranks, fmt::format("internal: {}", error.what()), ExitCode::numerical_failure);
    }
    petsc.end();
    return code;
  } catch (const pliant::Error& error) {
    pliant::complain(fmt::format("pliant: error: {}\n", error.what()));
    return static_cast<int>(error.code());
  }
}
