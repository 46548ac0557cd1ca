// Main program.
#include <pliant/scenarios/program.h>

int main(int argc, char** argv) { return pliant::run_all_scenarios(argc, argv); }
