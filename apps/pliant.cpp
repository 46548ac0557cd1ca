// Main program: the list of its scenarios.
#include <pliant/run/scenario.h>
#include <pliant/scenarios/channel/channel.h>
#include <pliant/scenarios/clog/clog.h>
#include <pliant/scenarios/evaluate/evaluate.h>
#include <pliant/scenarios/hopper/hopper.h>
#include <pliant/scenarios/raft/raft.h>

int main(int argc, char** argv) {
  return pliant::run_program(argc, argv,
                             {pliant::hopper_scenario(), pliant::raft_scenario(), pliant::clog_scenario(),
                              pliant::channel_scenario(), pliant::evaluate_scenario()});
}
