// The program: picks a scenario, nothing else.
#include <fmt/format.h>

#include <cstdio>
#include <string>
#include <vector>

#include <pliant/base/errors.h>
#include <pliant/base/nearest.h>
#include <pliant/base/options.h>
#include <pliant/base/petsc.h>
#include <pliant/base/version.h>
#include <pliant/scenarios/evaluate.h>
#include <pliant/scenarios/hopper.h>

namespace {

using pliant::ExitCode;
using pliant::InputError;
using Arguments = std::vector<std::string>;

constexpr const char* usage =
    "usage: pliant SCENARIO [-option value ...]\n"
    "\n"
    "scenarios:\n"
    "  hopper              gravity-driven flow through an orifice\n"
    "  evaluate CASE.json  energies and forces of one configuration\n"
    "\n"
    "pliant SCENARIO -help   options of a scenario\n"
    "pliant -version         version and build\n";

ExitCode hopper(const Arguments& arguments) {
  pliant::HopperOptions parameters;
  pliant::Options options;
  parameters.bind(options);
  if (arguments == Arguments{"-help_markdown"}) {  // what docs/options.md is made from
    fmt::print("{}", options.markdown());
    return ExitCode::done;
  }
  switch (options.parse(arguments)) {
    case pliant::Options::Request::help:
      fmt::print("usage: pliant hopper [-option value ...]\n\n{}", options.help());
      break;
    case pliant::Options::Request::version:
      fmt::print("{}", pliant::build_info().text());
      break;
    case pliant::Options::Request::run:
      return pliant::run_hopper(parameters, options);
  }
  return ExitCode::done;
}

ExitCode evaluate(const Arguments& arguments) {
  if (arguments.size() != 1 || arguments[0] == "-help") {
    const char* text = "usage: pliant evaluate CASE.json (docs/evaluate.md describes the file)";
    if (arguments.size() != 1) throw InputError("{}", text);
    fmt::print("{}\n", text);
    return ExitCode::done;
  }
  fmt::print("{}\n", pliant::to_text(pliant::evaluate(pliant::read_case(arguments[0]), arguments[0])));
  return ExitCode::done;
}

ExitCode run(const std::string& scenario, const Arguments& arguments) {
  if (scenario == "hopper") return hopper(arguments);
  if (scenario == "evaluate") return evaluate(arguments);
  if (scenario == "-help" || scenario == "--help" || scenario == "-h") {
    fmt::print("{}", usage);
    return ExitCode::done;
  }
  if (scenario == "-version" || scenario == "--version") {
    fmt::print("{}", pliant::build_info().text());
    return ExitCode::done;
  }
  const std::vector<std::string> scenarios{"hopper", "evaluate"};
  const auto near = pliant::nearest(scenario, scenarios);
  throw InputError("unknown scenario '{}'{}; pliant -help lists them", scenario,
                   near ? fmt::format(", did you mean '{}'?", *near) : std::string());
}

}  // namespace

int main(int argc, char** argv) {
  const Arguments arguments(argv + std::min(argc, 2), argv + argc);
  try {
    if (argc < 2) throw InputError("no scenario given; pliant -help lists them");
    pliant::PetscSession petsc;
    return static_cast<int>(run(argv[1], arguments));
  } catch (const pliant::Error& error) {
    fmt::print(stderr, "pliant: error: {}\n", error.what());
    return static_cast<int>(error.code());
  } catch (const std::exception& error) {
    fmt::print(stderr, "pliant: internal error: {}\n", error.what());
    return static_cast<int>(ExitCode::numerical_failure);
  }
}
