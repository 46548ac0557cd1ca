// Runs of one simulation, and of several at the same time.
#include <pybind11/stl.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <system_error>
#include <thread>

#include <pliant/python/simulation.h>

namespace pliant::python {
namespace {

void run(AnySimulation& simulation, std::optional<Real> duration, std::int64_t count,
         const std::vector<Callback>& callbacks, py::object force) {
  const EngineUse use(EngineUse::Kind::run);
  const std::unique_ptr<Run> run = simulation.begin_run(duration, count, callbacks, std::move(force));
  {
    const py::gil_scoped_release released;
    run->compute(nullptr);
  }
  run->end();
  check_signals();
}

/// Threads that compute runs, one run at a time each. The runs stop once interrupt has an exception.
void compute_all(const std::vector<std::unique_ptr<Run>>& runs, std::size_t threads, PendingError& interrupt) {
  std::atomic<bool> stop = false;
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::condition_variable ended;
  std::size_t busy = 0;
  const auto work = [&] {
    for (std::size_t k = next++; k < runs.size() && !stop; k = next++)
      if (runs[k]) runs[k]->compute(&stop);
    const std::lock_guard lock(mutex);
    --busy;
    ended.notify_one();
  };
  std::vector<std::jthread> team;
  std::unique_lock lock(mutex);
  try {
    for (; busy < threads; ++busy) team.emplace_back(work);
  } catch (const std::system_error&) {
    if (team.empty()) throw MemoryError("the system could not start a thread");
  }
  constexpr auto patience = std::chrono::milliseconds(50);
  while (!ended.wait_for(lock, patience, [&] { return busy == 0; })) {
    interrupt.guard(check_signals);
    if (interrupt) stop = true;
    if (!is_fork()) continue;  // a signal handler has forked: the process of the child has no other threads
    for (std::jthread& thread : team) thread.detach();
    return;
  }
}

/// The exception of Python code, as an object.
py::object exception_of(PendingError& pending) {
  try {
    pending.rethrow();
    check_signals();
  } catch (const py::error_already_set& error) {
    if (error.trace()) PyException_SetTraceback(error.value().ptr(), error.trace().ptr());
    return error.value();
  }
  return py::none();
}

/// Runs each simulation for its duration, or not at all without one, on several threads. Returns an exception or None
/// for each, and the exception that has interrupted them all, or None. Errors, before any simulation has moved:
/// InputError.
py::tuple advance(const std::vector<AnySimulation*>& simulations, const std::vector<std::optional<Real>>& durations,
                  std::size_t threads) {
  const EngineUse use(EngineUse::Kind::run);
  std::vector<std::unique_ptr<Run>> runs(simulations.size());
  std::vector<std::exception_ptr> errors(simulations.size());
  for (std::size_t k = 0; k < runs.size(); ++k) {
    if (!durations[k]) continue;
    try {
      if (simulations[k]->needs_petsc())
        throw InputError("its integrator is one of PETSc, which computes on one thread; call its run(){}",
                         simulations[k]->inertial() ? ", or use verlet" : "");
      runs[k] = simulations[k]->begin_run(durations[k], -1, {}, py::none());
    } catch (const NumericalError&) {
      errors[k] = std::current_exception();
    } catch (const Error& error) {
      throw Error(error.code(), fmt::format("simulation {}: {}", k, error.what()));
    }
  }
  PendingError interrupt;
  {
    const EngineAtWork computing;
    const py::gil_scoped_release released;
    compute_all(runs, std::min(threads, runs.size()), interrupt);
  }
  if (is_fork()) {
    interrupt.rethrow();
    check_process();
  }
  py::list results;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    try {
      if (runs[k]) runs[k]->end();
    } catch (...) {
      errors[k] = std::current_exception();
    }
    results.append(errors[k] ? python_error(errors[k]) : py::none());
  }
  return py::make_tuple(results, exception_of(interrupt));
}

}  // namespace

void bind_runs(py::module_& m) {
  m.def("run", run);
  m.def("advance", advance);
}

}  // namespace pliant::python
