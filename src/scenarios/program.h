// The program pliant, in a header that includes no other, so that apps compiles fast.
#pragma once

namespace pliant {

/// main() with the scenarios of the table.
int run_all_scenarios(int argc, char** argv);

}  // namespace pliant
