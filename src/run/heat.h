// Columns of a run for its energy budget.
#pragma once

#include <fmt/format.h>

#include <vector>

#include <pliant/base/ranks.h>
#include <pliant/io/run_writer.h>
#include <pliant/model/contact_history.h>
#include <pliant/run/energy_audit.h>

namespace pliant {

/// Appends the heat since the start by each cause that a term with history names, "TERM_CAUSE". Returns the sum.
/// Collective.
inline Real add_heat(std::vector<SeriesValue>& row, const ContactHistory& history, const Ranks& ranks) {
  Real all = 0;
  for (const ContactTable& table : history.tables()) {
    std::vector<Real> heat(table.heat().begin(), table.heat().end());
    ranks.sum(heat);
    for (std::size_t k = 0; k < heat.size(); ++k) {
      row.emplace_back(fmt::format("{}_{}", table.needs().name, table.needs().losses[k]), heat[k]);
      all += heat[k];
    }
  }
  return all;
}

/// Appends, with inertia, the heat of contacts by cause, and `work` and `heat` since the start: the sum of all energies
/// changes by work − heat. Without inertia `work` and `dissipated`. Collective.
template <int D>
void add_budget(std::vector<SeriesValue>& row, EnergyAudit<D>& audit, Simulation<D>& simulation) {
  if (simulation.overdamped() != nullptr) {
    row.emplace_back("work", audit.work());
    row.emplace_back("dissipated", audit.heat());
    return;
  }
  const Real heat = add_heat(row, simulation.particles().history(), simulation.ranks());
  row.emplace_back("work", audit.work());
  row.emplace_back("heat", heat + audit.sampled_heat());
}

}  // namespace pliant
