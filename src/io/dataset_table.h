// Units and descriptions of the datasets of run.h5.
#pragma once

#include <string>

#include <pliant/io/run_writer.h>

namespace pliant {

/// JSON {path: {"units", "description"}} for every dataset that runs can write, also if this run does not write it. In
/// paths, * stands for any text: the number of a frame, or the name of a term. Units are spelled as in the scenario; a
/// number without unit has empty units.
std::string dataset_table(const Manifest& manifest);

}  // namespace pliant
