// The program pliant. This header includes no other header, so that apps/pliant.cpp compiles fast.
#pragma once

namespace pliant {

/// main() with the scenarios of the table.
int run_all_scenarios(int argc, char** argv);

}  // namespace pliant
