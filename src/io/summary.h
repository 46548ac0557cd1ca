// summary.json: results of a run.
#pragma once

#include <pliant/base/types.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string_view>

namespace pliant {

/// A measured quantity {"value", "error", "unit"}: error is one standard error; values that are not finite become null.
nlohmann::ordered_json quantity(Real value, Real error, std::string_view unit);

/// "no_error" of quantities of a flow that has ended: they are averages over the flow and the rest after it.
namespace no_flow {
inline constexpr std::string_view clogged = "clogged", at_rest = "at rest";
}

/// Writes folder/summary.json atomically. Errors: OutputError.
void write_summary(const std::filesystem::path& folder, const nlohmann::ordered_json& summary);

/// Removes the summary of a run, if there is one, before the run continues: the results in the summary do not include
/// the data that the run will write. Errors: OutputError.
void drop_summary(const std::filesystem::path& folder);

}  // namespace pliant
