#include <pliant/io/atomic_file.h>
#include <pliant/io/summary.h>

#include <cmath>

namespace pliant {
namespace {

nlohmann::ordered_json number_or_null(Real a) {
  return std::isfinite(a) ? nlohmann::ordered_json(a) : nlohmann::ordered_json(nullptr);
}

}  // namespace

nlohmann::ordered_json quantity(Real value, Real error, std::string_view unit) {
  return {{"value", number_or_null(value)}, {"error", number_or_null(error)}, {"unit", unit}};
}

void write_summary(const std::filesystem::path& folder, const nlohmann::ordered_json& summary) {
  // A message may hold bytes that are not UTF-8 (a file name): replace them rather than lose the summary.
  const auto replace = nlohmann::ordered_json::error_handler_t::replace;
  write_file_atomically(folder / "summary.json", {summary.dump(2, ' ', false, replace), "\n"});
}

}  // namespace pliant
