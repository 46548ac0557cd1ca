// Scenarios as functions: the program's table, run with its arguments.
#include <pybind11/stl.h>

#include <array>
#include <csignal>

#include <pliant/base/console.h>
#include <pliant/python/engine.h>
#include <pliant/run/run_control.h>
#include <pliant/scenarios/evaluate/evaluate.h>
#include <pliant/scenarios/table.h>

namespace pliant::python {
namespace {

/// Reports a run to a Python object: its methods begin(folder), progress(t, end, text), say(text), warn(text).
class Listener final : public RunMonitor, public ConsoleSink {
 public:
  explicit Listener(py::object listener) : listener_(std::move(listener)) {}

  void begin(const std::string& folder) override {
    folder_ = folder;
    tell("begin", folder);
  }
  void progress(Real t, Real end, const std::string& text) override { tell("progress", t, end, text); }
  bool stop() override {
    error_.guard(check_signals);
    return static_cast<bool>(error_);
  }
  void say(std::string_view text) noexcept override { tell("say", text); }
  void warn(std::string_view text) noexcept override { tell("warn", text); }

  const std::string& folder() const { return folder_; }
  PendingError& error() { return error_; }

 private:
  template <class... Args>
  void tell(const char* method, const Args&... args) noexcept {
    error_.guard([&] { listener_.attr(method)(args...); });
  }

  py::object listener_;
  std::string folder_;
  PendingError error_;
};

/// A run replaces the responses to signals, and keeps its own where one has come: afterwards they are the interpreter's
/// again.
class InterpreterSignals {
 public:
  InterpreterSignals() {
    for (std::size_t k = 0; k < before_.size(); ++k) sigaction(StopSignals::signals[k], nullptr, &before_[k]);
  }
  ~InterpreterSignals() {
    for (std::size_t k = 0; k < before_.size(); ++k) sigaction(StopSignals::signals[k], &before_[k], nullptr);
  }
  InterpreterSignals(const InterpreterSignals&) = delete;
  InterpreterSignals& operator=(const InterpreterSignals&) = delete;

 private:
  std::array<struct sigaction, StopSignals::signals.size()> before_{};
};

const Scenario& scenario_of(const std::vector<Scenario>& all, const std::string& name) {
  for (const Scenario& s : all)
    if (s.name == name && s.table) return s;
  throw InputError("there is no scenario {} with options", name);
}

/// Runs a scenario to its end, or until it is stopped, and returns its folder. A signal that has stopped the run
/// reaches the interpreter after the checkpoint is written: SIGINT becomes KeyboardInterrupt.
std::string run_scenario(const std::string& name, const Arguments& arguments, py::object object) {
  const EngineUse use(EngineUse::Kind::run);
  const std::vector<Scenario> all = all_scenarios();
  const Scenario& scenario = scenario_of(all, name);
  Listener listener(std::move(object));
  int signal = 0;
  std::exception_ptr failure;
  {
    const InterpreterSignals signals;
    const py::gil_scoped_release released;
    try {
      scenario.run(arguments, Ranks(PETSC_COMM_WORLD));
      if (!listener.folder().empty()) signal = StopSignals::signal();
    } catch (...) {
      failure = std::current_exception();
    }
  }
  listener.error().rethrow();
  if (failure) std::rethrow_exception(failure);
  if (signal != 0) std::raise(signal);
  check_signals();
  return listener.folder();
}

py::list scenarios() {
  py::list list;
  const py::object loads = py::module_::import("json").attr("loads");
  for (const Scenario& s : all_scenarios())
    if (s.table) list.append(py::make_tuple(s.name, s.help, s.units, loads(s.table().dump())));
  return list;
}

/// JSON text of the energies and forces, and a remark about older names.
std::pair<std::string, std::string> evaluate_text(const std::string& document, const std::string& name) {
  const EngineUse use(EngineUse::Kind::access);
  std::string remark;
  std::string result = evaluate(nlohmann::json::parse(document), name, &remark).dump();
  return {std::move(result), std::move(remark)};
}

}  // namespace

void bind_scenarios(py::module_& m) {
  m.def("scenarios", scenarios, "[(name, help, units, options)] of all scenarios that have options.");
  m.def("run_scenario", run_scenario, py::arg("name"), py::arg("arguments"), py::arg("listener"),
        "Runs a scenario with arguments of its command line; returns its folder.");
  m.def(
      "read_case", [](const std::string& file) { return read_case(file).dump(); }, py::arg("file"));
  m.def("evaluate", evaluate_text, py::arg("document"), py::arg("name"));
}

}  // namespace pliant::python
