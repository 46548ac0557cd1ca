// summary.json: results of a run.
#pragma once

#include <pliant/base/types.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string_view>

namespace pliant {

/// A measured quantity {"value", "error", "unit"}: error is one standard error; values that are not finite become null.
nlohmann::ordered_json quantity(Real value, Real error, std::string_view unit);

/// Writes folder/summary.json atomically. Errors: OutputError.
void write_summary(const std::filesystem::path& folder, const nlohmann::ordered_json& summary);

/// Removes the summary, if there is one, of a run that goes on: its results are older than the data that follow.
/// Errors: OutputError.
void drop_summary(const std::filesystem::path& folder);

}  // namespace pliant
