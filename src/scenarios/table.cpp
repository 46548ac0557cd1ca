#include <pliant/scenarios/table.h>

#include <pliant/scenarios/channel/channel.h>
#include <pliant/scenarios/clog/clog.h>
#include <pliant/scenarios/evaluate/evaluate.h>
#include <pliant/scenarios/hopper/hopper.h>
#include <pliant/scenarios/packings/scenarios.h>
#include <pliant/scenarios/program.h>
#include <pliant/scenarios/raft/raft.h>
#include <pliant/scenarios/vibrate/vibrate.h>

namespace pliant {

std::vector<Scenario> all_scenarios() {
  return {hopper_scenario(), raft_scenario(),  clog_scenario(),    channel_scenario(),
          pack_scenario(),   shear_scenario(), vibrate_scenario(), evaluate_scenario()};
}

int run_all_scenarios(int argc, char** argv) { return run_program(argc, argv, all_scenarios()); }

}  // namespace pliant
