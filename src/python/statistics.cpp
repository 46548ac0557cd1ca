// Statistics of series, as in the program.
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <pliant/analysis/block_average.h>
#include <pliant/analysis/steady_state.h>
#include <pliant/python/simulation.h>

namespace pliant::python {
namespace {

std::span<const Real> series_of(const Array& array, const char* name) {
  if (array.ndim() != 1) throw InputError("{} must be a series, an array [n]", name);
  const std::span<const Real> values(array.data(), static_cast<std::size_t>(array.size()));
  for (std::size_t k = 0; k < values.size(); ++k)
    if (!std::isfinite(values[k])) throw InputError("{}[{}] is {}; give finite numbers", name, k, values[k]);
  return values;
}

py::dict dict_of(const BlockAverage& average) {
  py::dict d;
  d["mean"] = average.mean;
  d["error"] = average.error;
  d["error_of_error"] = average.error_of_error;
  d["lower_bound"] = average.lower_bound;
  d["inefficiency"] = average.inefficiency;
  d["block_size"] = average.block_size;
  d["plateau"] = average.plateau;
  return d;
}

/// The reason why the flow may not be steady; its mean rate is then not a steady rate. Empty if the test finds no
/// reason.
std::string change_of_rate(std::span<const Real> time, std::span<const Real> crossed) {
  constexpr std::size_t fewest = 51;  // the test needs 50 rates
  if (time.size() < 2) return "fewer than two samples";
  if (time.size() < fewest)
    return fmt::format("{} samples are too few to test it, which takes {}", time.size(), fewest);
  const std::vector<Real> rate = rate_series(time, crossed);
  const NamedSeries series{.name = "flow rate", .values = rate};
  const std::string change = drift(series);
  if (change.empty()) return change;
  const SteadyState steady = steady_state(time.subspan(1), {&series, 1});
  return steady.steady ? fmt::format("{}; it is steady from t = {:g} on", change, steady.time) : change;
}

}  // namespace

void bind_statistics(py::module_& m) {
  m.def("block_average", [](const Array& values) { return dict_of(block_average(series_of(values, "series"))); });
  m.def("flow_rate", [](const Array& time, const Array& crossed) {
    const std::span<const Real> times = series_of(time, "time"), counts = series_of(crossed, "crossed");
    const FlowRate rate = flow_rate(times, counts);
    py::dict d;
    d["change"] = change_of_rate(times, counts);
    d["value"] = rate.value;
    d["error"] = rate.error;
    d["correlation_time"] = rate.correlation_time;
    return d;
  });
  m.def("start_up", [](const Array& values) { return mser5(series_of(values, "series")); });
}

}  // namespace pliant::python
