// Units and descriptions of the datasets of run.h5.
#pragma once

#include <nlohmann/json.hpp>

#include <pliant/io/run_writer.h>

namespace pliant {

/// {path: {"units", "description"}} for the datasets of a run, also those that other runs write. In paths, * stands for
/// any text: the number of a frame, or the name of a term. Units are those of the scenario; empty: a number without
/// unit.
nlohmann::ordered_json dataset_table(const Manifest& manifest);

}  // namespace pliant
