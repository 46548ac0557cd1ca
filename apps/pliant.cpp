// Main program.
#include <pliant/scenarios/table.h>

int main(int argc, char** argv) { return pliant::run_program(argc, argv, pliant::all_scenarios()); }
