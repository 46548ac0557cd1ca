#include <pliant/io/json_file.h>
#include <pliant/io/summary.h>

#include <cmath>
#include <system_error>

#include <pliant/base/errors.h>

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
  write_json(folder / "summary.json", summary);
}

void drop_summary(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "summary.json";
  if (std::error_code error; !std::filesystem::remove(file, error) && error)
    throw OutputError("cannot remove {}: {}; make the folder writable", file.string(), error.message());
}

}  // namespace pliant
